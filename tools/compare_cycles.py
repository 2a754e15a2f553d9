"""The Cycles side of compare_cycles.sh; Blender's Python runs it.

blender -b --factory-startup --python tools/compare_cycles.py -- SEQ OUT CASE SAMPLES THREADS

Builds the scene of a sequence folder that `lumen render` wrote: mesh, first pose, camera, light sources (sls). CASE:
"diffuse", or "whole", which adds a texture and a glossy coat on a relief: alike, not the same. Renders it twice with
different seeds and writes OUT.exr (the second) and OUT.txt: noise and CPU seconds as lumen_bench_render has them, and
how far the mean is from that of OUT's picture by lumen, for which ".cycles" in OUT stands as ".lumen".
"""
import math
import os
import sys
import time
import tomllib

import bpy
import numpy as np

ALBEDO = (0.80, 0.35, 0.30)
SENSOR_MM = 36.0  # width; a unit for the polynomial's argument
BOUNCES = 7


def read_mesh(path):
    """Vertices (n, 3) and triangles (m, 3) of a binary PLY as lumen writes it."""
    with open(path, "rb") as file:
        counts = {}
        while (line := file.readline().split()) != [b"end_header"]:
            if line[0] == b"element":
                counts[line[1]] = int(line[2])
        vertices = np.fromfile(file, "<f8", 3 * counts[b"vertex"]).reshape(-1, 3)
        faces = np.fromfile(file, np.dtype([("n", "u1"), ("corner", "<i4", 3)]), counts[b"face"])
    return vertices, faces["corner"][:, ::-1]  # Cycles takes what lies behind a front for the inside of glass


def read_pose(path):
    """world_from_camera (4, 4) of the first frame."""
    with open(path) as file:
        return np.array([float(x) for x in file.readline().split(",")]).reshape(4, 4).T


def add_mesh(vertices, triangles, smooth):
    mesh = bpy.data.meshes.new("wall")
    mesh.vertices.add(len(vertices))
    mesh.vertices.foreach_set("co", vertices.astype(np.float32).ravel())
    mesh.loops.add(3 * len(triangles))
    mesh.loops.foreach_set("vertex_index", triangles.ravel())
    mesh.polygons.add(len(triangles))
    mesh.polygons.foreach_set("loop_start", np.arange(0, 3 * len(triangles), 3, dtype=np.int32))
    mesh.polygons.foreach_set("loop_total", np.full(len(triangles), 3, dtype=np.int32))
    mesh.polygons.foreach_set("use_smooth", np.full(len(triangles), smooth))
    mesh.update()
    mesh.validate()
    link("wall", mesh)
    return mesh


def link(name, data):
    thing = bpy.data.objects.new(name, data)
    bpy.context.scene.collection.objects.link(thing)
    return thing


# Blender's camera looks along -z with y up.
BLENDER_AXES = np.diag([1.0, -1.0, -1.0, 1.0])


def add_camera(camera, world_from_camera):
    """A fisheye whose angle is a polynomial of the radius, fitted to Scaramuzza's, whose radius is one of the angle's
    cotangent. Answers by how many pixels it is off at most. The centre must be the image's and the pixels square."""
    if camera["stretch"] != [1, 0, 0] or [camera["cx"], camera["cy"]] != [
            (camera["width"] - 1) / 2, (camera["height"] - 1) / 2]:
        sys.exit("compare_cycles: Cycles' fisheye is centred and isn't stretched")
    radius_px = np.linspace(0, math.hypot(camera["width"], camera["height"]) / 2, 2000)
    angle = np.arctan2(radius_px, np.polyval(camera["a"][::-1], radius_px))
    radius_mm = radius_px * SENSOR_MM / camera["width"]
    powers = np.stack([radius_mm**k for k in range(1, 5)], axis=1)
    k = np.linalg.lstsq(powers, angle, rcond=None)[0]
    off_px = np.max(np.abs(powers @ k - angle) / np.gradient(angle, radius_px))
    data = bpy.data.cameras.new("camera")
    data.type = "PANO"
    data.sensor_fit = "HORIZONTAL"
    data.sensor_width = SENSOR_MM
    data.sensor_height = SENSOR_MM * camera["height"] / camera["width"]
    data.clip_start = 1e-3
    data.cycles.panorama_type = "FISHEYE_LENS_POLYNOMIAL"
    data.cycles.fisheye_fov = 2 * math.pi
    data.cycles.fisheye_polynomial_k0 = 0
    for i in range(4):
        setattr(data.cycles, f"fisheye_polynomial_k{i + 1}", -k[i])
    thing = link("camera", data)
    thing.matrix_world = (world_from_camera @ BLENDER_AXES).T.tolist()
    bpy.context.scene.camera = thing
    return off_px


def add_light(source, world_from_camera):
    """A point whose radiant intensity is intensity * exp(-spread * (1 - cos)); Cycles' point of power P, W, has
    P / (4 pi) W/sr in each channel, times the emission's strength."""
    data = bpy.data.lights.new("guide", "POINT")
    data.energy = 4 * math.pi * source["intensity"][0]
    data.shadow_soft_size = 1e-3
    data.cycles.use_multiple_importance_sampling = False
    data.use_nodes = True
    tree = data.node_tree
    tree.nodes.clear()

    def math_node(operation, a, b):
        node = tree.nodes.new("ShaderNodeMath")
        node.operation = operation
        for slot, value in zip(node.inputs, (a, b)):
            if isinstance(value, float):
                slot.default_value = value
            else:
                tree.links.new(value, slot)
        return node.outputs[0]

    # The direction in which the light leaves, in the light's own axes: its axis is -z.
    leaving = tree.nodes.new("ShaderNodeTexCoord").outputs["Normal"]
    parts = tree.nodes.new("ShaderNodeSeparateXYZ")
    tree.links.new(leaving, parts.inputs[0])
    cosine = math_node("MULTIPLY", parts.outputs["Z"], -1.0)
    fall = math_node("MULTIPLY", math_node("SUBTRACT", cosine, 1.0), float(source["spread"]))
    emission = tree.nodes.new("ShaderNodeEmission")
    tree.links.new(math_node("POWER", math.e, fall), emission.inputs["Strength"])
    output = tree.nodes.new("ShaderNodeOutputLight")
    tree.links.new(emission.outputs[0], output.inputs[0])
    thing = link("guide", data)
    pose = world_from_camera.copy()
    pose[:3, 3] = (world_from_camera @ [*source["position"], 1])[:3]
    thing.matrix_world = (pose @ BLENDER_AXES).T.tolist()


def add_material(mesh, whole):
    material = bpy.data.materials.new("mucosa")
    material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    diffuse = tree.nodes.new("ShaderNodeBsdfDiffuse")
    diffuse.inputs["Color"].default_value = (*ALBEDO, 1)
    mesh.materials.append(material)
    if not whole:
        tree.links.new(diffuse.outputs[0], output.inputs["Surface"])
        return

    def noise(wave_mm):
        place = tree.nodes.new("ShaderNodeTexCoord").outputs["Object"]
        node = tree.nodes.new("ShaderNodeTexNoise")
        node.inputs["Scale"].default_value = 1 / wave_mm
        node.inputs["Detail"].default_value = 1  # two octaves, as lumen's
        tree.links.new(place, node.inputs["Vector"])
        return node.outputs["Fac"]

    clouds = tree.nodes.new("ShaderNodeMixRGB")
    clouds.inputs["Color1"].default_value = (*(0.8 * a for a in ALBEDO), 1)
    clouds.inputs["Color2"].default_value = (*(min(1.0, 1.2 * a) for a in ALBEDO), 1)
    tree.links.new(noise(7), clouds.inputs["Fac"])
    tree.links.new(clouds.outputs[0], diffuse.inputs["Color"])
    bump = tree.nodes.new("ShaderNodeBump")
    bump.inputs["Distance"].default_value = 2 * 0.06  # the noise's range is 1, the relief's twice its height
    tree.links.new(noise(0.5), bump.inputs["Height"])
    glossy = tree.nodes.new("ShaderNodeBsdfGlossy")
    glossy.distribution = "GGX"
    glossy.inputs["Color"].default_value = (1, 1, 1, 1)
    glossy.inputs["Roughness"].default_value = 0.2
    tree.links.new(bump.outputs[0], glossy.inputs["Normal"])
    fresnel = tree.nodes.new("ShaderNodeFresnel")
    fresnel.inputs["IOR"].default_value = 1.37
    tree.links.new(bump.outputs[0], fresnel.inputs["Normal"])
    mix = tree.nodes.new("ShaderNodeMixShader")
    tree.links.new(fresnel.outputs[0], mix.inputs["Fac"])
    tree.links.new(diffuse.outputs[0], mix.inputs[1])
    tree.links.new(glossy.outputs[0], mix.inputs[2])
    tree.links.new(mix.outputs[0], output.inputs["Surface"])


def set_up_renderer(width, height, threads):
    scene = bpy.context.scene
    scene.world = bpy.data.worlds.new("dark")
    scene.world.color = (0, 0, 0)
    scene.render.engine = "CYCLES"
    scene.render.resolution_x, scene.render.resolution_y = width, height
    scene.render.resolution_percentage = 100
    scene.render.threads_mode, scene.render.threads = "FIXED", threads
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth = "32"
    scene.render.image_settings.color_mode = "RGB"
    cycles = scene.cycles
    cycles.device = "CPU"
    cycles.use_adaptive_sampling = cycles.use_denoising = False
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0
    cycles.blur_glossy = 0
    cycles.light_sampling_threshold = 0
    cycles.max_bounces = cycles.diffuse_bounces = cycles.glossy_bounces = BOUNCES
    cycles.caustics_reflective = True
    cycles.pixel_filter_type = "BOX"
    cycles.filter_width = 1
    cycles.use_auto_tile = False
    scene.render.use_persistent_data = True  # what is measured is tracing, not building the tree of boxes


def render(out, samples, seed):
    """Linear radiance (height, width, 3), upper row first, and the CPU seconds that it took."""
    scene = bpy.context.scene
    scene.cycles.samples, scene.cycles.seed = samples, seed
    scene.render.filepath = out + ".exr"
    start = time.process_time()
    bpy.ops.render.render(write_still=True)
    seconds = time.process_time() - start
    return read_picture(scene.render.filepath), seconds


def read_picture(path):
    image = bpy.data.images.load(path)
    pixels = np.empty(4 * image.size[0] * image.size[1], np.float32)
    image.pixels.foreach_get(pixels)
    width, height = image.size
    bpy.data.images.remove(image)
    return pixels.reshape(height, width, 4)[::-1, :, :3].astype(np.float64)


def main():
    folder, out, case, samples, threads = sys.argv[sys.argv.index("--") + 1:]
    samples = int(samples)
    with open(os.path.join(folder, "sequence.toml"), "rb") as file:
        sequence = tomllib.load(file)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    pose = read_pose(os.path.join(folder, "pose.txt"))
    mesh = add_mesh(*read_mesh(os.path.join(folder, "mesh.ply")), smooth=case == "whole")
    add_material(mesh, case == "whole")
    off_px = add_camera(sequence["camera"], pose)
    for source in sequence["light"]["source"]:
        add_light(source, pose)
    set_up_renderer(sequence["camera"]["width"], sequence["camera"]["height"], int(threads))

    render(out, 1, 0)  # builds the tree of boxes
    first, few_seconds = render(out, 1, 1)
    (first, first_seconds), (second, second_seconds) = render(out, samples, 1), render(out, samples, 2)
    weights = np.array([0.2126, 0.7152, 0.0722])
    a, b = first @ weights, second @ weights
    mean = np.mean(a + b) / 2
    noise = math.sqrt(np.mean((a - b)**2) / 2) / mean
    # Handing the scene over and writing the picture are not what is compared: a sample's time is the difference.
    each = ((first_seconds + second_seconds) / 2 - few_seconds) / (samples - 1)
    needed = samples * (noise / 0.055)**2
    by_lumen = read_picture(out.replace(".cycles", ".lumen") + ".exr").mean((0, 1))
    off = 100 * ((first + second).mean((0, 1)) / 2 / by_lumen - 1)
    off_by_luminance = 100 * (mean / (by_lumen @ weights) - 1)
    with open(out + ".txt", "w") as file:
        print(f"  to 5.5% {needed * each:34.2f} CPU-s ({needed:.1f} samples of {each:.3f} CPU-s; "
              f"{samples} have {100 * noise:.2f}%)", file=file)
        print(f"  mean, less lumen's {off_by_luminance:+24.3f}%  "
              f"(R {off[0]:+.3f}%, G {off[1]:+.3f}%, B {off[2]:+.3f}%; "
              f"Cycles' standard error {100 * noise / math.sqrt(2 * a.size):.3f}%; "
              f"camera within {off_px:.1f} px)", file=file)


main()
