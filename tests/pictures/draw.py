"""Draws pictures with every renderer at hand, and compares the drawings.

    python3 draw.py FOLDER SHEETS

Draws each SVG file of FOLDER. A renderer may place a letter half a pixel off and smooth a line in its own way; averaged over squares of
16 pixels, a drawing is that of the other renderers, unless something is missing in it. Writes one sheet of drawings side by side for
each picture into SHEETS, to be looked at. Needs Pillow and NumPy, and at least four of the renderers.
"""

import importlib.util
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

import numpy as np
from PIL import Image, ImageDraw

# Side of the squares that are averaged, pixels, and the largest difference of two averages, of 255 levels.
SQUARE = 16
LARGEST = 48.0


def chromium(source, target, size):
    flags = ["--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", f"--window-size={size[0]},{size[1]}"]
    page = target.with_suffix(".html")
    page.write_text(f'<body style="margin:0;background:white"><img src="{source.resolve().as_uri()}" width="{size[0]}"></body>')
    subprocess.run([shutil.which("chromium"), *flags, f"--screenshot={target}", page.as_uri()], check=True, capture_output=True)


def command(*words):
    def draw(source, target, size):
        named = {"{source}": str(source), "{target}": str(target), "{width}": str(size[0])}
        filled = [re.sub(r"\{\w+\}", lambda name: named[name[0]], word) for word in words]
        subprocess.run(filled, check=True, capture_output=True)

    return draw


def cairosvg(source, target, size):
    import cairosvg

    cairosvg.svg2png(url=str(source), write_to=str(target), output_width=size[0], background_color="white")


def renderers():
    """The renderers of this machine, by name."""
    programs = {
        "rsvg-convert": command("rsvg-convert", "--width={width}", "--background-color=white", "--output={target}", "{source}"),
        "resvg": command("resvg", "--width={width}", "--background=white", "{source}", "{target}"),
        "inkscape": command("inkscape", "--export-width={width}", "--export-background=white", "--export-filename={target}", "{source}"),
        "chromium": chromium,
    }
    found = {name: draw for name, draw in programs.items() if shutil.which(name)}
    return found | ({"cairosvg": cairosvg} if importlib.util.find_spec("cairosvg") else {})


def size_of(source):
    """Width and height of a picture, pixels, from its view box."""
    box = re.search(r'viewBox="([^"]*)"', source.read_text(encoding="utf-8"))
    _, _, width, height = (float(number) for number in box[1].split())
    return round(width), round(height)


def averages(drawing, size):
    """Grey levels averaged over squares; a strip at the edge narrower than a square is left out."""
    grey = np.asarray(drawing.convert("L").resize(size), dtype=float)
    rows, columns = grey.shape[0] // SQUARE, grey.shape[1] // SQUARE
    return grey[: rows * SQUARE, : columns * SQUARE].reshape(rows, SQUARE, columns, SQUARE).mean((1, 3))


def sheet(name, drawings, target):
    width, height = next(iter(drawings.values())).size
    whole = Image.new("RGB", (2 * width, ((len(drawings) + 1) // 2) * (height + 16)), "grey")
    for number, (renderer, drawing) in enumerate(drawings.items()):
        place = (number % 2 * width, number // 2 * (height + 16))
        whole.paste(drawing, (place[0], place[1] + 16))
        ImageDraw.Draw(whole).text((place[0] + 4, place[1] + 2), f"{name}: {renderer}", "white")
    whole.save(target)


def main(folder, sheets):
    sheets.mkdir(parents=True, exist_ok=True)
    found, pictures, wrong = renderers(), sorted(folder.glob("*.svg")), 0
    print(f"{len(pictures)} pictures, by {', '.join(found)}")
    if len(found) < 4 or not pictures:
        sys.exit(f"{folder} needs an SVG file, and this machine four of the renderers")
    for picture in pictures:
        size, drawings = size_of(picture), {}
        with tempfile.TemporaryDirectory() as scratch:
            for name, draw in found.items():
                target = pathlib.Path(scratch) / f"{name}.png"
                try:
                    draw(picture, target, size)
                    with Image.open(target) as drawing:
                        flat = Image.new("RGBA", drawing.size, "white")
                        flat.alpha_composite(drawing.convert("RGBA"))
                        drawings[name] = flat.convert("RGB").resize(size)
                except (subprocess.CalledProcessError, OSError, ValueError, AttributeError) as error:
                    wrong += 1
                    print(f"{picture.name}: {name} does not draw it: {error}")
        levels = {name: averages(drawing, size) for name, drawing in drawings.items()}
        common = np.median(list(levels.values()), axis=0)
        distances = {name: np.abs(level - common).max() for name, level in levels.items()}
        if common.std() < 1.0:
            wrong += 1
            print(f"{picture.name}: it is blank")
        for name, distance in distances.items():
            if distance > LARGEST:
                wrong += 1
                print(f"{picture.name}: {name} draws something else: {distance:.0f} of 255 levels in a square")
        print(f"{picture.name}: {max(distances.values()):.0f}")
        sheet(picture.stem, drawings, sheets / f"{picture.stem}.png")
    sys.exit(f"{wrong} drawings differ" if wrong else 0)


if __name__ == "__main__":
    main(pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2]))
