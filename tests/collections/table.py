"""The table of outcomes in the folders of a box: table.py BOX"""

import collections
import json
import pathlib
import re
import sys

box = pathlib.Path(sys.argv[1])
outcomes = ["restored", "untouched", "failed", "stays"]
counts = collections.defaultdict(collections.Counter)
sentences = collections.defaultdict(list)


def kind(name):
    return pathlib.Path(name).suffix.lower() or "(none)"


for path in (box / "outbox").glob("*.json"):
    report = json.loads(path.read_text())
    counts[kind(report["photo"])][report["outcome"]] += 1
    for note in report["notes"]:
        if note.startswith("not in the result"):
            sentences[note].append(report["photo"])
for path in (box / "failed").glob("*.txt"):
    photo = path.name.removesuffix(".txt")
    if (box / "failed" / photo).exists():
        counts[kind(photo)]["failed"] += 1
        reason = path.read_text().splitlines()[2]
        # Sentences that differ only in numbers are counted as one.
        sentences[re.sub(r"\d+", "#", reason.replace(photo, "FILE"))].append(photo)
for path in (box / "inbox").rglob("*"):
    if path.is_file():
        counts[kind(path.name)]["stays"] += 1
# Files that stay without a line here are no photos.
for line in (box / "log").read_text(errors="replace").splitlines():
    if waits := re.match("warning: kept in the inbox: (.*?): (.*)", line):
        sentences[re.sub(r"\d+", "#", waits[2])].append(waits[1])

print("kind", *outcomes, sep="\t")
for ending, found in sorted(counts.items(), key=lambda row: -sum(row[1].values())):
    print(ending, *(found[outcome] for outcome in outcomes), sep="\t")
print()
for sentence, photos in sorted(sentences.items(), key=lambda row: -len(row[1])):
    print(len(photos), sentence, f"({photos[0]})", sep="\t")
