"""Contact between bodies and within one, of particles of any methods, by impulses between their steps."""
