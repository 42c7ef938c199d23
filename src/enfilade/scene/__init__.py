"""Scenes and the renderers that read them: Mitsuba's, or your own (:mod:`enfilade.scene.opener`)."""
