"""Mitsuba 3, embedded (Jakob et al. 2022): the renderer that comes with enfilade."""
