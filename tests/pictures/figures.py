"""Writes each figure of an HTML page of `flotor analyse` as a file of its own, with the page's style sheet.

    python3 figures.py PAGE.html NAME

The files are NAME-1.svg, NAME-2.svg, ... in the current folder.
"""

import re
import sys

page = open(sys.argv[1], encoding="utf-8").read()
figures = re.findall(r"<svg\b.*?</svg>", page, re.DOTALL)
if not figures:
    sys.exit(f"{sys.argv[1]} has no figure")
for number, figure in enumerate(figures, 1):
    if "xmlns=" not in figure.split(">", 1)[0]:
        figure = figure.replace("<svg", '<svg xmlns="http://www.w3.org/2000/svg"', 1)
    open(f"{sys.argv[2]}-{number}.svg", "w", encoding="utf-8").write(figure)
