#!/usr/bin/env python3
"""Compares a picture by cousu with what Mitsuba 3, an independent renderer, makes of the same scene and camera.

    cousu render SCENE.obj -o PICTURE.exr --size 256x160 --spp 4096 [--orbit RX,RY]
    compare-mitsuba.py SCENE.obj PICTURE.exr [--seed N]

Angles and samples are read from the command that the picture carries. Everything but the comparison is Mitsuba's: it
reads the scene, has a camera of its own, traces rays (Embree), and its `direct` integrator samples a diffuse surface
of albedo 1, seen from both sides, under a sky of radiance 1. What leaves such a surface, with no light but the sky's
and no second bounce, is

    1/pi * integral over the hemisphere of V(p, w) (n.w) dw = A(p),

which cousu renders. Only directions of the surface are sampled, none of the sky, so each sample is 0 or 1, as in
cousu, and a pixel of mean a and n samples has variance a (1 - a) / n: the noise below is of both pictures' pixels by
this formula. As in cousu, all samples of a pixel share one camera ray, through its centre; a film would spread them
over the pixel, so the camera is asked for these rays one by one, and no film is used. Normals are the triangles'.
What remains different on purpose is how far above its surface an ambient ray starts.

Compared are the pixels that both pictures cover. Exit codes: 0 the mean difference is at most 0.0003, allowing for
three standard errors; 1 it is more, or the pictures cannot be compared; 2 the command line is wrong.

Needs the packages mitsuba and numpy of PyPI, which `make second-opinion` installs, and libLLVM, by which Mitsuba
compiles for the CPU. (Mitsuba 3.8.0 does with LLVM 15; 3.9.1 does not.)
"""

import argparse
import json
import shlex
import sys
import time
from math import cos, radians, sin

import mitsuba as mi
import numpy as np

TOLERANCE = 0.0003
FIELD_OF_VIEW = 45.0  # of cousu's orbiter, vertical
RAYS_AT_ONCE = 1 << 22


def main():
    options = command_line()
    try:
        mi.set_variant("llvm_ad_rgb")
    except ImportError:
        sys.exit("Mitsuba finds no libLLVM: install what Debian 12 calls libllvm15, or name it in DRJIT_LIBLLVM_PATH.")
    mi.set_log_level(mi.LogLevel.Error)

    cousu, cousu_covers, spp, orbit = read_picture(options.picture)
    start = time.monotonic()
    mitsuba, mitsuba_covers = render(options.scene, cousu.shape, spp, orbit, options.seed)
    seconds = time.monotonic() - start

    both = cousu_covers & mitsuba_covers
    pixels = np.count_nonzero(both)
    if pixels == 0:
        sys.exit("No pixel is covered in both pictures.")
    difference = np.where(both, mitsuba - cousu, 0.0)
    variance = np.where(both, cousu * (1.0 - cousu) + mitsuba * (1.0 - mitsuba), 0.0) / spp
    mean, error = difference.sum() / pixels, np.sqrt(variance.sum()) / pixels
    y, x = np.unravel_index(np.argmax(np.abs(difference)), difference.shape)

    print(f"pixels   {pixels} covered in both, {np.count_nonzero(cousu_covers ^ mitsuba_covers)} in one only; "
          f"{spp} samples each, Mitsuba's in {seconds:.1f} s")
    print(f"mean     cousu {cousu[both].mean():.6f}, Mitsuba less cousu {mean:+.6f}, standard error {error:.6f}")
    print(f"RMS      {np.sqrt((difference ** 2).sum() / pixels):.6f}, "
          f"by noise alone {np.sqrt(variance.sum() / pixels):.6f}")
    print(f"worst    {difference[y, x]:+.4f} at column {x}, row {y}: cousu {cousu[y, x]:.4f}, "
          f"Mitsuba {mitsuba[y, x]:.4f}, noise {np.sqrt(variance[y, x]):.4f}")
    if abs(mean) - 3.0 * error > TOLERANCE:
        sys.exit(f"The mean difference exceeds {TOLERANCE}.")


def command_line():
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("scene", help="the OBJ file")
    parser.add_argument("picture", help="cousu's EXR file of it")
    parser.add_argument("--seed", type=int, default=0, help="of Mitsuba's random numbers")
    return parser.parse_args()


def read_picture(path):
    """The light of a picture by cousu, which pixels it covers, its samples a pixel and the angles of its camera."""
    bitmap = mi.Bitmap(path)
    command = shlex.split(json.loads(bitmap.metadata()["cousu"])["command"])
    for other in ("--eye", "--target", "--up", "--fov", "--max-distance"):
        if option(command, other):
            sys.exit(f"{path} was rendered with {other}, which has no counterpart here.")
    spp = int(option(command, "--spp") or 64)
    cornell = any(word.endswith("cornell.obj") for word in command)
    orbit = option(command, "--orbit") or ("0,0" if cornell else "20,140")
    pixels = np.array(bitmap.convert(mi.Bitmap.PixelFormat.RGBA, mi.Struct.Type.Float32, False))
    return pixels[..., 0].astype(np.float64), pixels[..., 3] == 1.0, spp, [float(angle) for angle in orbit.split(",")]


def option(command, name):
    for word, following in zip(command, command[1:] + [""]):
        if word == name:
            return following
        if word.startswith(name + "="):
            return word.partition("=")[2]
    return None


def render(path, shape, spp, orbit, seed):
    """Light and coverage by Mitsuba."""
    height, width = shape
    white = {"type": "diffuse", "reflectance": {"type": "rgb", "value": 1.0}}
    scene = mi.load_dict({
        "type": "scene",
        "mesh": {
            "type": "obj",
            "filename": path,
            "face_normals": True,
            "bsdf": {"type": "twosided", "bsdf": white},
        },
        "sky": {"type": "constant", "radiance": {"type": "rgb", "value": 1.0}},
    })
    camera = orbiter(scene.bbox(), orbit, width, height)
    integrator = mi.load_dict(
        {"type": "direct", "bsdf_samples": 1, "emitter_samples": 0, "hide_emitters": True})

    def camera_rays(pixels):
        centres = mi.Point2f((pixels % width + 0.5) / width, (pixels // width + 0.5) / height)
        return camera.sample_ray_differential(0.0, 0.5, centres, mi.Point2f(0.5))[0]

    covers = np.array(scene.ray_intersect(camera_rays(np.arange(width * height))).is_valid())
    pixels = np.flatnonzero(covers)
    light = np.zeros(width * height)
    # Several samples of all pixels at once.
    at_once = max(1, RAYS_AT_ONCE // max(1, pixels.size))
    for first in range(0, spp if pixels.size else 0, at_once):
        samples = min(at_once, spp - first)
        sampler = mi.load_dict({"type": "independent"})
        sampler.seed(seed * spp + first, samples * pixels.size)
        radiance, _, _ = integrator.sample(scene, sampler, camera_rays(np.tile(pixels, samples)))
        light[pixels] += np.array(radiance.y, dtype=np.float64).reshape(samples, -1).sum(axis=0)
    return (light / spp).reshape(shape), covers.reshape(shape)


def orbiter(box, orbit, width, height):
    """cousu's default camera: one diagonal of the scene's box from its centre, turned about y, then about x."""
    (rx, ry), centre, diagonal = map(radians, orbit), np.array(box.center()), np.linalg.norm(box.extents())
    backward = np.array([-cos(rx) * sin(ry), sin(rx), cos(rx) * cos(ry)])
    up = np.array([sin(rx) * sin(ry), cos(rx), -sin(rx) * cos(ry)])
    return mi.load_dict({
        "type": "perspective",
        "fov": FIELD_OF_VIEW,
        "fov_axis": "y",
        "near_clip": 1e-3 * diagonal,
        "far_clip": 10.0 * diagonal,
        "to_world": mi.ScalarTransform4f().look_at(centre + backward * diagonal, centre, up),
        "film": {"type": "hdrfilm", "width": width, "height": height},
    })


if __name__ == "__main__":
    main()
