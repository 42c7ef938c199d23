"""What becomes of each node, light and object: the tables of docs/blender.md."""

from enfilade_blender.materials.table import LOBES

BECOMES = {  # shader nodes of one lobe
    "BSDF_DIFFUSE": "`diffuse`",
    "BSDF_GLOSSY": "`conductor` or `roughconductor` without Fresnel",
    "BSDF_METALLIC": "`conductor` or `roughconductor`",
    "BSDF_GLASS": "`dielectric` or `roughdielectric`",
    "BSDF_REFRACTION": "`dielectric` or `roughdielectric`",
    "BSDF_TRANSPARENT": "`mask`: alone it passes the luminance of its colour, in mixes and sums all light",
    "BSDF_TRANSLUCENT": "`principledthin`",
    "SUBSURFACE_SCATTERING": "`diffuse`",
    "BSDF_SHEEN": "`diffuse`",
    "BSDF_TOON": "`diffuse`",
    "BSDF_HAIR": "`roughconductor`",
    "BSDF_HAIR_PRINCIPLED": "`diffuse`",
}
PRINCIPLED = (
    (
        "Base Color, Metallic 0",
        "mapped",
        "`diffuse` under a dielectric interface: `plastic` or `roughplastic`",
    ),
    ("Base Color, Metallic 1", "mapped", "`conductor` or `roughconductor`, of a fitted index of refraction"),
    ("Metallic in between, or textured", "mapped", "`blendbsdf` of both"),
    ("Base Color of a metal, textured", "approximated", "its reflectance; no brighter edges"),
    (
        "Roughness",
        "mapped",
        "GGX, alpha its square; with multiple scattering if Multiscatter, but for textured metals and glass",
    ),
    (
        "Roughness of 0.55 to 0.8 without Metallic",
        "approximated",
        "bright colours as of 0.8; else as of 0.55: highlights are smaller",
    ),
    (
        "Roughness of 0.8 and more without Metallic",
        "mapped",
        "`diffuse`, lighter by the mean of its reflections",
    ),
    ("Roughness, textured", "mapped", "`blendbsdf` of two plastics; `alpha` on metals"),
    ("IOR, Specular IOR Level", "mapped", "index of refraction of the interface"),
    ("Transmission Weight", "mapped", "`dielectric` or `roughdielectric`; `blendbsdf` in between"),
    ("Alpha", "mapped", "`mask`"),
    (
        "Emission Color, Emission Strength",
        "mapped",
        "`area` emitter; meshes that are open, partly transparent, or around something shine on both sides",
    ),
    (
        "Normal: Normal Map, Bump of images of Strength 1",
        "mapped",
        "`normalmap`, `bumpmap`; mirrored UV maps and the backs of open meshes have maps of their own",
    ),
    (
        "Bump of images, Strength below 1",
        "approximated",
        "`bumpmap` of the same mean slope: steep slopes are too steep, flat ones too flat",
    ),
    ("Normal Map of another UV map than its image's", "baked", "a `normalmap` of each mesh"),
    (
        "Displacement node, Bump Only",
        "mapped",
        "`bumpmap` where the shader has no normals of its own; heights are those of an object without scale",
    ),
    ("Displacement and Bump", "approximated", "`bumpmap`: outlines are smooth"),
    ("Displacement Only, vectors, beside normals of its own", "not carried", "the surface is smooth"),
    ("Volume", "not carried", "the object is without it"),
    (
        "Coat",
        "mapped",
        "`blendbsdf` with a `roughconductor` of k = 0; with a `conductor` over smooth metal and glass",
    ),
    ("Coat Tint, Coat Normal", "not carried", "the coat is clear and even"),
    ("Sheen", "approximated", "a rough dielectric layer of the same mean albedo"),
    ("Anisotropic", "approximated", "`alpha_u`, `alpha_v` of metals along the UV map; left out if textured"),
    ("Anisotropic Rotation", "not carried", "highlights are stretched along the UV map"),
    ("Specular Tint", "approximated", "on metals a colour at edges; else left out"),
    ("Diffuse Roughness", "not carried", "the surface is Lambertian"),
    ("Subsurface", "approximated", "diffuse reflection of the base colour"),
    ("Thin Film", "not carried", "no interference colours"),
)
INPUTS = (
    ("Constants, RGB, Value", "mapped", "numbers"),
    (
        "Image Texture with UV Map and Mapping, or a channel of it",
        "mapped",
        "`bitmap` with `to_uv`, `wrap_mode`, `filter_type`, `raw`",
    ),
    (
        "Attribute of vertices, corners or faces",
        "mapped",
        "`mesh_attribute`; baked: light, its alpha or number, several in one material, what nodes make of it",
    ),
    ("Image of the extension Clip whose border lies on the mesh", "baked", "a bitmap of each mesh"),
    ("Colour corrections of images on the UV map", "baked", "a bitmap over the unit square of the images"),
    ("Baked heights and normals", "baked", "OpenEXR files of 32 bits"),
    (
        "Everything else: noise, ramps, Object and Generated coordinates",
        "baked",
        "a bitmap of each mesh, on UVs of its own; those of a material share an atlas",
    ),
    (
        "Fresnel, Layer Weight below Glossy in a Mix Shader",
        "approximated",
        "glass; `plastic` with untinted reflections, `thindielectric` with sharp ones, or an even layer",
    ),
    ("Fresnel, Layer Weight elsewhere", "approximated", "baked as seen along the normal"),
    ("Coordinates and vectors of the camera", "approximated", "baked: the same from all directions"),
    (
        "Random of objects and islands; properties; OSL; attributes of edges, instances, particles and hairs",
        "approximated",
        "another number, or 0",
    ),
    (
        "Geometry: Position, Normal; coordinates of another object; Vector Transform of the world",
        "baked",
        "each copy of an object by itself; of more than 64 copies as at the first one's place",
    ),
    ("Bevel, Pointiness and Ambient Occlusion", "baked", "without the object's other material slots"),
    ("Bump of linked duplicates", "baked", "with the slopes of the first one, whatever their scale"),
    ("Light Path", "approximated", "0: all rays see one material"),
    (
        "Mix of clear glass and Transparent by Is Shadow Ray, as of windows",
        "approximated",
        "`thindielectric`: light passes, nothing is bent; on thick objects glass, which stops light",
    ),
    (
        "Mix with Transparent by Light Path, as of unlit glTF materials",
        "approximated",
        "the other shader, for all rays",
    ),
    ("Missing image, or missing first frame of an image sequence", "approximated", "a mid grey"),
)
LIGHTS = (
    ("Point", "mapped", "`sphere` of its radius, not seen by the camera; `point` for radius 0"),
    (
        "Spot",
        "approximated",
        "`spot`, also oval: a linear ramp as blend, without radius: shadows are sharp, glass stops its light",
    ),
    (
        "Soft Falloff of points and spots",
        "approximated",
        "falloff is quadratic: surfaces nearer than three radii are brighter",
    ),
    (
        "Area: square, rectangle, disk, ellipse",
        "mapped",
        "`rectangle` or `disk`; not seen by the camera",
    ),
    ("Sun of angle 0", "mapped", "`directional`"),
    (
        "Sun with an angle, beside a brighter one",
        "approximated",
        "`directional`: shadows are sharp, glass stops its light",
    ),
    ("Sun with an angle", "mapped", "a disc in the environment map, at least two of its pixels wide"),
    (
        "Nodes of lights: emissions of constants and what is computed of them, sums, mixes, Light Falloff",
        "mapped",
        "a factor; falloff is quadratic",
    ),
    ("Point or area that the camera sees", "approximated", "a black surface that emits, and casts shadows"),
    ("IES profiles of constant strength", "approximated", "light of the profile's mean intensity"),
    ("Area that is a portal", "mapped", "left out: it emits nothing"),
    ("Lamps and emitting meshes without area", "not carried", "they give no light"),
    ("World of one colour", "mapped", "`constant`"),
    ("World of nodes: HDRI, sky", "baked", "`envmap`"),
    (
        "Spread, negative power, emission and world, light and shadow linking, patterns of nodes of lights",
        "not carried",
        "light is distributed as without them",
    ),
)
OBJECTS = (
    ("Mesh, curve, surface, text, metaball", "mapped", "triangles after modifiers, with split normals"),
    (
        "Collection, geometry nodes and particle instances, linked duplicates",
        "mapped",
        "merged, or `instance` where they are many",
    ),
    ("Linked libraries, files of images", "mapped", "within the source's folder and the allowed ones"),
    (
        "Animated objects, lamps, materials, worlds, images and exposure",
        "not carried",
        "as in the first frame",
    ),
    (
        "Motion in scenes of more than 100,000 objects and copies, or of many of them in many frames",
        "approximated",
        "looked for in a part of them, which a note tells",
    ),
    ("Gamma, curves and white balance of the view", "not carried", "left out"),
    (
        "Limits of bounces",
        "approximated",
        "`max_depth`: the larger of diffuse and glossy; 1 more among plastics, 2 with glass; all with `mask`",
    ),
    ("Frame step", "not carried", "every frame is rendered"),
    ("Culling of Simplify", "not carried", "all objects are there"),
    ("Adaptive subdivision", "approximated", "of the modifier's levels"),
    ("Hair, point clouds, volumes, grease pencil", "not carried", "missing"),
    (
        "Triangles, objects and lamps with a vertex, place or light that is NaN or infinite",
        "not carried",
        "missing",
    ),
    (
        "Meshes that only emit, are flat or closed, and that the camera does not see",
        "approximated",
        "lamps: the camera does not see them; they cast no shadows",
    ),
    ("Clear glass without a shadow", "approximated", "a thin pane, unless it is a thick object"),
    (
        "Glass of an open mesh, as a window of one plane",
        "approximated",
        "`thindielectric`, or `principledthin` if it is rough: nothing is bent",
    ),
    ("Other meshes that the camera does not see", "mapped", "BSDFs whose id says so; mirrors show them"),
    (
        "Other ray visibility of meshes, shadow catcher, holdout, indirect only",
        "not carried",
        "visible to all rays",
    ),
    ("Transparent Shadows switched off", "not carried", "light passes where the surface is transparent"),
    ("Clipping of cameras", "not carried", "all is visible from the eye on"),
    (
        "Cameras below a turned parent of uneven scale",
        "approximated",
        "oblique axes become the principal point; shear of the picture itself is left out",
    ),
    (
        "Cameras far from the origin, or within 0.1 units of what they see",
        "approximated",
        "shadows are lost near contacts",
    ),
    (
        "Caustics switched off, clamping, Fast GI, limits of bounces of lights and the world",
        "not carried",
        "all light counts",
    ),
    ("Compositor, sequencer, Freestyle, burnt-in metadata", "not carried", "left out"),
    (
        "Overrides and filter of the view layer, further view layers, render region, stereoscopy",
        "not carried",
        "left out",
    ),
    ("Working spaces of Blender 5 but Linear Rec.709", "not carried", "colours are taken as Linear Rec.709"),
    ("File of a newer Blender than the one that reads it", "not carried", "what that one does not know"),
    ("Missing fonts and caches, drivers that need Python", "not carried", "as Blender shows them without"),
)


def markdown():
    """The tables as a section of the documentation."""
    parts = []
    shaders = [
        (
            name.removeprefix("BSDF_").replace("_", " ").capitalize(),
            "approximated" if kind.note else "mapped",
            f"{BECOMES[name]}: {kind.effect}" if kind.effect else BECOMES[name],
        )
        for name, kind in LOBES.items()
    ]
    shaders += [
        (
            "Mix shader",
            "mapped",
            "`blendbsdf`; with Transparent `mask`; with Fresnel see Inputs",
        ),
        (
            "Add shader",
            "approximated",
            "an `area` emitter beside the other shader; else `blendbsdf` of equal shares",
        ),
        ("Emission", "mapped", "`area` emitter"),
        ("Smooth shaders mixed with rough ones", "mapped", "rough ones of alpha 0.001, which is not seen"),
        (
            "Beckmann, Ashikhmin-Shirley",
            "approximated",
            "GGX of single scattering: highlights fade out further away",
        ),
        ("Any other shader", "not carried", "a neutral grey"),
    ]
    sections = {
        "Principled BSDF": PRINCIPLED, "Other shaders": shaders, "Inputs": INPUTS, "Lights and world": LIGHTS,
        "Objects": OBJECTS,
    }  # fmt: skip
    for title, rows in sections.items():
        parts.append(f"| {title} | outcome | in the exported scene |\n| --- | --- | --- |")
        parts[-1] += "".join(f"\n| {what} | {how} | {becomes} |" for what, how, becomes in rows)
    return "\n\n".join(parts) + "\n"
