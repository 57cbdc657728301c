"""Runs of variants of a scene, and what they say: error bars, targets, studies, the choice with least error."""
