"""Annotators' labels: names, index paths, and the tree they make."""

from __future__ import annotations

import random

import pytest
import tiny_scan

from s2a.scan import labels


@pytest.mark.parametrize(
    ("label", "name", "path"),
    [
        ("handle base.1.2.1", "handle base", ("1", "2", "1")),
        ("door.1.1.2_1", "door", ("1", "1", "2_1")),
        ("cabnet.", "cabnet", ()),
        ("  box   lid .3. 1.", "box lid", ("3", "1")),
        ("door..1", "door", ("1",)),
        ("lamp", "lamp", ()),
        ("", "", ()),
    ],
)
def test_labels_split_into_name_and_index_path(label, name, path):
    assert labels.split(label) == (name, path)


@pytest.mark.parametrize(
    ("name", "expected"),
    [("handle base", "handle_base_4"), ("3d printer", "_3d_printer_4"), ("Tür/links", "T_r_links_4"), ("", "part_4")],
)
def test_part_ids_are_names_that_usd_accepts(name, expected):
    assert labels.part_id(name, 4) == expected


def test_the_nearest_existing_ancestor_is_the_parent_and_names_play_no_role():
    found = labels.parents(
        {7: "handle.1.2.1.1", 1: "door frame.1", 2: "knob.1.2", 10: "lamp.10", 5: "shade.10.2_1", 6: "x.1.20"}
    )
    assert found == {7: 2, 1: None, 2: 1, 10: None, 5: 10, 6: 1}
    assert labels.depths(found) == {7: 2, 1: 0, 2: 1, 10: 0, 5: 1, 6: 1}


def test_an_underscore_does_not_nest():
    assert labels.parents({1: "a.1", 2: "b.1.2", 3: "c.1.2_1", 4: "d.1.2_1.3"}) == {1: None, 2: 1, 3: 1, 4: 3}


def random_tree(seed: int) -> dict[int, int | None]:
    """Return the parents of 60 parts, in random order with random numbers."""
    chance = random.Random(seed)
    numbers = chance.sample(range(1000), 60)
    tree = {n: chance.choice([None, *numbers[:i]]) for i, n in enumerate(numbers)}
    return dict(chance.sample(sorted(tree.items()), len(tree)))


@pytest.mark.parametrize("seed", range(20))
def test_any_tree_survives_being_written_as_labels(seed):
    tree = random_tree(seed)
    assert labels.parents(tiny_scan.labels_of(tree)) == tree
    order = labels.parents_first(tree)
    assert sorted(order) == sorted(tree)
    assert all(tree[n] is None or order.index(tree[n]) < order.index(n) for n in order)


def test_only_the_deepest_descendants_are_graspable():
    parent_of = {1: None, 2: 1, 3: 2, 4: 3, 5: 3, 6: 2}  # 6 is a hinge beside the handle base 3 with two handles
    assert labels.grasped({2}, parent_of) == {4, 5}
    assert labels.grasped({2, 6}, parent_of) == {4, 5, 6}
    assert labels.grasped(set(), parent_of) == set()
