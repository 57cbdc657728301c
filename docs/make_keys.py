"""python docs/make_keys.py: write docs/keys.md, the page of all keys of a scene."""

from pathlib import Path

from parsolid.commands.keys.listing import page

Path(__file__).with_name("keys.md").write_text(page(), encoding="utf-8")
