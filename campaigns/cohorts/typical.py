"""The median size of the one effect that challenges hide, counted from its null, by their answers on standard input."""

import json
import sys
from statistics import median

# Effects whose first parameter is not 0 where they are not there.
NULLS = {"fractional-damping": 1.0}

text, sizes, decoder = sys.stdin.read(), [], json.JSONDecoder()
while text.strip():
    document, end = decoder.raw_decode(text.lstrip())
    text = text.lstrip()[end:]
    (effect,) = document["truth"]["effects"]
    sizes.append(abs(effect["parameters"][0]["value"] - NULLS.get(effect["slug"], 0.0)))
print(f"{median(sizes):.6g}")
