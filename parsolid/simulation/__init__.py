"""One run: loop, recorder, probes, ledger, restart, signals."""
