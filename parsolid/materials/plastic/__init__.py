"""Elastic-plastic laws and their parts."""
