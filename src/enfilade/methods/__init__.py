"""How frames come from a scene and a camera path: one folder a method."""
