"""Laws of bonds that break."""
