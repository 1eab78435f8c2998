"""Every reader under a few hostile inputs; `python -m fuzz.campaign` has thousands."""

import random

import pytest

from drake_ispace.blocks.errors import InputError
from fuzz import campaign
from fuzz.readers import READERS, Csv, Images, Reader, SceneFile, Silent

INPUTS = {"campaign": 15}


@pytest.mark.parametrize("name", READERS)
def test_a_reader_refuses_in_one_sentence_or_reads_what_stands_there(name, tmp_path):
    counts, failed = campaign.attack(name, INPUTS.get(name, 60), 1, tmp_path)
    assert not failed
    assert counts["refused"]


class Careless(Reader):
    """A reader with every fault."""

    def attack(self, given):
        if given == "strange":
            raise ZeroDivisionError("of its own")
        if given == "other":
            raise Silent("it is another")
        if given == "mute":
            raise InputError("")
        while given == "long":
            pass


@pytest.mark.parametrize("given, said", [
    ("strange", "ZeroDivisionError"), ("other", "silent"), ("mute", "not one sentence"), ("long", "longer than"),
    ("good", "accepted"),
])
def test_the_attack_sees_every_fault(given, said, tmp_path, monkeypatch):
    monkeypatch.setattr(campaign, "LONGEST_S", 0.05)
    assert campaign.outcome(Careless(tmp_path), given).startswith(said)


def test_inputs_depend_on_the_seed_alone(tmp_path):
    (tmp_path / "one").mkdir()
    reader = Csv(tmp_path / "one")
    first, second = ([reader.input(random.Random(5)) for _ in range(3)] for _ in range(2))
    assert first == second


def test_a_picture_with_a_wrong_last_checksum_is_refused(tmp_path):
    """Its decoder has all pixels by then, and compares no more."""
    picture = bytearray(Images(tmp_path).seeds[".png"])
    picture[-13] ^= 1
    assert campaign.outcome(Images(tmp_path), b".png\n" + bytes(picture)) == "refused"


def test_a_byte_order_mark_before_a_number_is_refused(tmp_path):
    assert campaign.outcome(Csv(tmp_path), b"t\n\xef\xbb\xbf1\n2\n") == "refused"


def test_a_byte_order_mark_within_yaml_is_refused(tmp_path):
    assert campaign.outcome(SceneFile(tmp_path), SceneFile.SEEDS[0] + "\ufeff") == "refused"


def test_a_tab_between_words_is_yaml(tmp_path):
    tabbed = SceneFile.SEEDS[0].replace("width_m: 1.5", "width_m: \t1.5")
    assert campaign.outcome(SceneFile(tmp_path), tabbed) == "accepted"
