# SPDX-License-Identifier: GPL-3.0-or-later
"""Random sequences of our operators and Blender's in one Blender, with everything checked after each step.

Run by test_survival.py: `python survival_campaign.py FOLDER --first SEED --sequences N --steps N`. Writes
FOLDER/campaign.json: failures (each with the shortest sequence that still fails), and how often each operator ended
how. `--again FILE` repeats the shortest sequences of an earlier campaign.json.
"""

import argparse
import json
import sys
from collections import Counter
from itertools import count
from pathlib import Path
from random import Random

sys.path.insert(0, str(Path(__file__).resolve().parent))

import bpy
from survival_actions import ACTIONS, FILE_ACTIONS, to_object_mode
from survival_log import Failure, Log
from survival_parameters import AFTER, NOT_ALONE, parameters, prepare
from survival_scene import PACKAGE, STARTS, build_start, load_extension
from survival_state import (
    content,
    difference,
    faults,
    linked,
    mark_sources,
    material_digest,
    shared_tags,
    undoable,
    unused,
)

OURS_SHARE = 0.45
UNDO_CHECK_SHARE = 0.3
FILE_STEPS = ("undo", "redo", "save", "reload", *FILE_ACTIONS)
FILE_SHARE = 0.2
UNDO_STEPS = 256
TRIES = 4
"""Selections and modes tried until an operator accepts one; the last one is taken in any case."""
RARE = {"light_scene": 0.1}
"""Operators that render: drawn that much less often."""
SETTLED = {"check", "clear_tag", "fill_color", "lock_lights", "pair_tags", "repair_tags", "set_strength", "tag_thin"}
"""Operators that, called once more, find nothing left to change."""
MEANT_TO_SHARE = {"assign_tag"}
"""Operators that give one tag to all that is selected, as the artist asks."""
FIRST_AUTOMATIC = 1 << 20
"""Tag ids from here on come from pairing."""


class Sequence:
    """One file and its undo history, step by step."""

    def __init__(self, folder, module, log):
        self.folder, self.module, self.log = folder, module, log
        self.saved = folder / "saved.blend"
        self.library = folder / "library.blend"
        self.results = Counter()

    def begin(self, start):
        """Open a start scene."""
        self.marks = count()
        self.library.unlink(missing_ok=True)
        self._open(self.folder / f"{start}.blend")
        bpy.ops.wm.save_as_mainfile(filepath=str(self.saved))
        self.log.mark()

    def _open(self, path):
        bpy.ops.wm.open_mainfile(filepath=str(path))
        bpy.context.preferences.edit.undo_steps = UNDO_STEPS
        bpy.ops.ed.undo_push(message="opened")
        self.history, self.place = [content()], 0
        self.unmarked, self.lost = set(), [set()]

    def step(self, name, seed):
        """Do one step and look at everything. Raises Failure."""
        random = Random(seed)
        if name.startswith("vlm."):
            self._ours(name.removeprefix("vlm."), random)
        elif name in FILE_STEPS:
            self._file_step(name, random)
        else:
            self._blenders(name, ACTIONS[name], random)
        self.log.require_no_traceback()
        found = faults(self.module)
        if found:
            raise Failure("; ".join(found[:4]))

    def _blenders(self, name, action, random, *rest):
        try:
            action(random, *rest)
        except RuntimeError as error:
            if "Traceback" in str(error):
                raise Failure(str(error)) from error
        bpy.ops.ed.undo_push(message=name)
        self._remember()

    def _file_step(self, name, random):
        if name in ("undo", "redo"):
            self._travel(-1 if name == "undo" else 1, random.randint(1, 3))
        elif name == "save":
            self._forget_edited()
            bpy.ops.wm.save_as_mainfile(filepath=str(self.saved))
            if not bpy.data.libraries:
                bpy.ops.wm.save_as_mainfile(filepath=str(self.library), copy=True)
        elif name == "reload":
            self._open(self.saved)
        else:
            self._blenders(name, FILE_ACTIONS[name], random, self.library)

    def _remember(self):
        del self.history[self.place + 1 :], self.lost[self.place + 1 :]
        self.history.append(content())
        self.lost.append(set())
        self.place += 1
        self.unmarked = {place for place in self.unmarked if place < self.place}

    def _forget_edited(self):
        """Meshes that are in edit mode are not compared at earlier steps any more.

        Saving writes their edits into them outside of undo, and Blender's undo then leaves them as saved
        (test_survival.py shows that without our add-on).
        """
        edited = {f"mesh {thing.data.name!r} " for thing in bpy.data.objects if thing.mode == "EDIT"}
        for lost in self.lost[: self.place]:
            lost |= edited

    def _travel(self, direction, count):
        """Undo (-1) or redo (1) so many steps; never to between our operator and the marks of what it made."""
        while count > 0:
            place = self.place + direction
            if not 0 <= place < len(self.history):
                return
            (bpy.ops.ed.undo if direction < 0 else bpy.ops.ed.redo)()
            self.place = place
            count -= place not in self.unmarked
            changed = difference(undoable(self.history[place]), undoable(content()))
            known = [key for key in changed if not key.startswith(tuple(self.lost[place]))]
            self._require_none(known, "undo" if direction < 0 else "redo")

    def _require_none(self, changed, after):
        if changed:
            raise Failure(f"after {after} these differ: {', '.join(changed[:4])}")

    def _ours(self, name, random):
        self._prepare(name, random)
        bpy.ops.ed.undo_push(message="prepared")
        self._remember()
        before = self.history[self.place]
        orphans, materials, shared = unused(), _materials(), shared_tags()
        values = parameters(name, random)
        self.log.note(f"{name}({values})")
        self.log.require_no_traceback()
        result = self._call(name, values)
        said = self.log.require_no_traceback()
        self.results[f"{name} {result}"] += 1
        self.log.note(result)
        if result != "FINISHED" or not _adds_undo_step(name):
            self._require_none(difference(before, content()), f"{name}, {result} without an undo step")
            return
        if not ("Info: " in said or "Warning: " in said):
            raise Failure(f"vlm.{name} says nothing of what it did")
        self._remember()
        self._require_none(difference(linked(before), linked(self.history[self.place])), f"{name}, in linked data,")
        self._require_sound(name, orphans, materials, shared)
        if name in SETTLED:
            self._call(name, values, adds_step=False)
            self._require_none(difference(self.history[self.place], content()), f"a second {name}")
        changed = difference(before, self.history[self.place])
        if changed and random.random() < UNDO_CHECK_SHARE:
            self._travel(-1, 1)
            self._travel(1, 1)
        if mark_sources(self.marks, changed):
            self.unmarked.add(self.place)
            bpy.ops.ed.undo_push(message="marked")
            self._remember()

    def _prepare(self, name, random):
        for _ in range(TRIES):
            try:
                prepare(random)
            except RuntimeError:
                self.results[f"{name} not prepared"] += 1
            if name in AFTER:
                before = content()
                self._call(AFTER[name], parameters(AFTER[name], random), adds_step=False)
                mark_sources(self.marks, difference(before, content()))
            if getattr(bpy.ops.vlm, name).poll():
                break

    def _call(self, name, values, adds_step=True):
        try:
            result = getattr(bpy.ops.vlm, name)("EXEC_DEFAULT", adds_step, **values)
        except RuntimeError as error:
            sentence = str(error)
            if "Traceback" in sentence or "context is incorrect" in sentence:
                raise Failure(f"vlm.{name}({values}): {sentence.strip()}") from error
            return "refused"
        except TypeError as error:
            raise Failure(f"vlm.{name}({values}): {error}") from error
        return next(iter(result))

    def _require_sound(self, name, orphans, materials, shared):
        new = unused() - orphans
        if new:
            raise Failure(f"vlm.{name} leaves data that nothing uses: {', '.join(sorted(new)[:4])}")
        if _materials() != materials:
            raise Failure(f"vlm.{name} changed a visible material")
        grown = {tag: names for tag, names in shared_tags().items() if tag not in shared}
        if name.startswith("draw_"):
            # a drawn light takes the id that an artist gave the surface, never one of pairing
            grown = {tag: names for tag, names in grown.items() if tag >= FIRST_AUTOMATIC}
        if grown and name not in MEANT_TO_SHARE:
            raise Failure(f"vlm.{name} made unrelated light meshes share tags: {grown}")


def _adds_undo_step(name):
    return "UNDO" in bpy.types.Operator.bl_rna_get_subclass_py(f"VLM_OT_{name}").bl_options


def _materials():
    return {material.name_full: material_digest(material) for material in bpy.data.materials}


def plan(seed, steps):
    """The start scene and the steps of one sequence, as (name, seed of its own)."""
    random = Random(seed)
    ours = [f"vlm.{name}" for name in sorted(dir(bpy.ops.vlm)) if name not in NOT_ALONE]
    chosen = [("vlm.create_from_selection", random.getrandbits(32))]
    while len(chosen) < steps:
        kind = random.random()
        if kind < OURS_SHARE:
            name = random.choice(ours)
            if random.random() > RARE.get(name.removeprefix("vlm."), 1.0):
                continue
        else:
            name = random.choice(FILE_STEPS if kind < OURS_SHARE + FILE_SHARE else list(ACTIONS))
        chosen.append((name, random.getrandbits(32)))
    return random.choice(STARTS), chosen


def first_fault(sequence, start, steps):
    """(index, sentence) of the first step after which something does not hold, or None."""
    sequence.begin(start)
    for index, (name, seed) in enumerate(steps):
        sequence.log.note(f"{index} {name} {seed}")
        try:
            sequence.step(name, seed)
        except Failure as failure:
            to_object_mode()
            return index, str(failure)
    return None


def shortest(sequence, start, steps, sentence):
    """Steps with all left out that the same kind of fault does not need."""
    kind = kind_of(sentence)
    index = len(steps) - 2
    while index >= 0:
        shorter = steps[:index] + steps[index + 1 :]
        found = first_fault(sequence, start, shorter)
        if found is not None and kind_of(found[1]) == kind:
            steps = shorter[: found[0] + 1]
            index = min(index, len(steps) - 1)
        index -= 1
    return steps


def kind_of(sentence):
    """What two failures have in common that are of one kind: the last line that tells anything, without names."""
    lines = [line for line in sentence.strip().splitlines() if not line.startswith("Location:")]
    return "".join(each for each in lines[-1].split("'")[0] if not each.isdigit())[:50]


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("folder", type=Path)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--sequences", type=int, default=10)
    parser.add_argument("--steps", type=int, default=30)
    parser.add_argument("--again", type=Path)
    parser.add_argument("--no-shrink", action="store_true")
    arguments = parser.parse_args()
    log = Log(arguments.folder / "campaign.log")
    load_extension()
    for start in STARTS:
        build_start(start, arguments.folder / f"{start}.blend")
    module = sys.modules[f"{PACKAGE}.vlm_addon.blender.light_meshes"]
    sequence = Sequence(arguments.folder, module, log)
    told = {"version": bpy.app.version_string, "failures": (failures := [])}
    for seed, start, steps in _sequences(arguments):
        log.note(f"sequence {seed} in {start}")
        found = first_fault(sequence, start, steps)
        if found is not None:
            results = sequence.results.copy()
            last = steps[: found[0] + 1]
            known = kind_of(found[1]) in {kind_of(each["sentence"]) for each in failures}
            short = last if arguments.no_shrink or known else shortest(sequence, start, last, found[1])
            sequence.results = results
            failures.append({"seed": seed, "start": start, "sentence": found[1], "steps": short})
            log.tell(f"sequence {seed} in {start}: {found[1][-400:]}\n    {[name for name, _ in short][-40:]}")
        told["results"] = dict(sorted(sequence.results.items()))
        (arguments.folder / "campaign.json").write_text(json.dumps(told, indent=1))
    log.tell(f"{len(failures)} sequences failed")


def _sequences(arguments):
    if arguments.again:
        earlier = json.loads(arguments.again.read_text())["failures"]
        return [(each["seed"], each["start"], [tuple(step) for step in each["steps"]]) for each in earlier]
    seeds = range(arguments.first, arguments.first + arguments.sequences)
    return [(seed, *plan(seed, arguments.steps)) for seed in seeds]


if __name__ == "__main__":
    main()
