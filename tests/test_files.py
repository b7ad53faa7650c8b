"""Files are complete or absent, and keep what stood there: permissions, links, the old content."""

from __future__ import annotations

import io
import json
import os
import stat
import subprocess
import sys
import zipfile

import numpy as np
import pytest

import antiosc as ao

MODEL = ao.AntiOscillators(m0=1.0, k0=1e6, m=[1.0, 2.0], omega=[1e3, 2e3])


def test_permissions_stay(tmp_path):
    path = tmp_path / "m.npz"
    path.write_bytes(b"old")
    for mode in (0o600, 0o640):
        path.chmod(mode)
        MODEL.save(path)
        assert stat.S_IMODE(path.stat().st_mode) == mode
    assert ao.AntiOscillators.load(path).n == 2


@pytest.mark.parametrize("exists", [True, False])
def test_a_link_stays_a_link(tmp_path, exists):
    (tmp_path / "far").mkdir()
    far = tmp_path / "far" / "real.npz"
    if exists:
        far.write_bytes(b"old")
    link = tmp_path / "m.npz"
    link.symlink_to(far)
    MODEL.save(link)
    assert link.is_symlink()
    assert ao.AntiOscillators.load(far).n == 2
    assert os.listdir(tmp_path / "far") == ["real.npz"]


@pytest.mark.parametrize("stop", [KeyboardInterrupt(), ValueError("no"), OSError(28, "full")])
def test_an_interrupted_write_changes_nothing(tmp_path, monkeypatch, stop):
    def interrupted(stream, *arrays, **options):
        stream.write(b"half")
        raise stop

    path = tmp_path / "m.npz"
    path.write_text("old")
    monkeypatch.setattr(np.lib.format, "write_array", interrupted)
    with pytest.raises(ao.InputError if isinstance(stop, OSError) else type(stop)):
        MODEL.save(path)
    assert (os.listdir(tmp_path), path.read_text()) == (["m.npz"], "old")


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("folder", "it is a folder"),
        ("pipe", "not a regular file"),
        ("circle", "not a regular file"),
        ("none/m.npz", "No such file"),
        ("file/m.npz", "Not a directory"),
        ("x" * 300, "File name too long"),
        ("\ud800", "surrogates not allowed"),
    ],
)
def test_no_place_for_a_file(tmp_path, name, says):
    (tmp_path / "folder").mkdir()
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "circle").symlink_to(tmp_path / "circle")
    (tmp_path / "file").write_text("")
    before = sorted(os.listdir(tmp_path))
    with pytest.raises(ao.InputError, match=rf"cannot write the model to .*{says}"):
        MODEL.save(tmp_path / name)
    assert sorted(os.listdir(tmp_path)) == before


def saved(tmp_path) -> dict[str, bytes]:
    """The members of a sound model file."""
    MODEL.save(tmp_path / "sound.npz")
    with zipfile.ZipFile(tmp_path / "sound.npz") as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def refused(tmp_path, members: dict[str, bytes], compression: int = zipfile.ZIP_STORED) -> str:
    """What `load` says of a file of these members."""
    path = tmp_path / "m.npz"
    with zipfile.ZipFile(path, "w", compression) as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    with pytest.raises(ao.InputError) as caught:
        ao.AntiOscillators.load(path)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def member(array: np.ndarray) -> bytes:
    stream = io.BytesIO()
    np.lib.format.write_array(stream, array)
    return stream.getvalue()


class Mine:
    """Unpickling it would be told."""

    ran = False

    def __reduce__(self):
        return setattr, (Mine, "ran", True)


def test_a_pickle_is_not_opened(tmp_path):
    good = saved(tmp_path)
    evil = np.empty(1, dtype=object)
    evil[0] = Mine()
    for name in ("m.npy", "header.npy", "extra.npy"):
        refused(tmp_path, {**good, name: member(evil)})
    assert not Mine.ran


def test_sizes_in_headers_are_not_believed(tmp_path):
    good = saved(tmp_path)
    for shape in ("(1000000000000,)", "(2, 10000000000)", "(3,)", "(1,)", "(-2,)", "(2.0,)"):
        head = good["m.npy"].replace(b"(2,), }", f"{shape}, }}".encode())
        assert head != good["m.npy"]
        refused(tmp_path, {**good, "m.npy": head})
    long = b"\x93NUMPY\x02\x00" + (2**31).to_bytes(4, "little") + b" " * 100
    refused(tmp_path, {**good, "m.npy": long})


@pytest.mark.slow
def test_a_bomb_is_not_blown_up(tmp_path):
    bomb = member(np.zeros(2**24))  # 128 MiB of zeros in 130 kB
    assert "at most" in refused(tmp_path, {**saved(tmp_path), "m.npy": bomb}, zipfile.ZIP_DEFLATED)
    many = {f"a{k}.npy": b"" for k in range(1000)}
    assert "at most" in refused(tmp_path, {**saved(tmp_path), **many})


def test_numbers_that_make_no_model(tmp_path):
    good = saved(tmp_path)
    header = json.loads(str(np.load(io.BytesIO(good["header.npy"]))))
    changes = [{"damping": 3}, {"damping": {"magic": 1}}, {"radius": "wide"}, {"info": 7}]
    for change in changes:
        text = member(np.array(json.dumps({**header, **change})))
        assert "no valid model" in refused(tmp_path, {**good, "header.npy": text})
    refused(tmp_path, {**good, "header.npy": member(np.array("[1, 2]"))})
    refused(tmp_path, {**good, "header.npy": member(np.array('{"format": "antiosc-model"}'))})
    for array in (np.zeros((2, 2)), np.array(["a", "b"]), np.array([np.nan, 1.0]), np.zeros(0)):
        assert "no valid model" in refused(tmp_path, {**good, "m.npy": member(array)})


@pytest.mark.slow
def test_damaged_copies_are_refused_or_right(tmp_path):
    saved(tmp_path)
    sound = (tmp_path / "sound.npz").read_bytes()
    path = tmp_path / "m.npz"
    rng = np.random.default_rng(1)
    for _ in range(300):
        content = bytearray(sound)
        for place in rng.integers(len(content), size=3):
            content[place] ^= 1 << rng.integers(8)
        if rng.random() < 0.5:
            del content[rng.integers(len(content)) :]
        path.write_bytes(content)
        try:
            model = ao.AntiOscillators.load(path)
        except ao.InputError:
            continue
        assert model.n == 2  # the damage was where nothing is read


@pytest.mark.parametrize("kind", ["folder", "pipe", "device", "long"])
def test_what_is_no_file_is_no_model(tmp_path, kind):
    (tmp_path / "folder").mkdir()
    os.mkfifo(tmp_path / "pipe")
    path = {"device": "/dev/zero", "long": "x" * 5000}.get(kind, tmp_path / kind)
    with pytest.raises(ao.InputError, match=r"no regular file|cannot read"):
        ao.AntiOscillators.load(path)


FULL = """
import resource, signal, sys
import antiosc as ao
model = ao.AntiOscillators(m0=1.0, k0=1e6, m=[1.0] * 5000, omega=range(1, 5001))
resource.setrlimit(resource.RLIMIT_FSIZE, (20000, 20000))
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
try:
    model.save(sys.argv[1] + ".npz") if sys.argv[2] == "npz" else ao.export(
        sys.argv[1] + ".fmu", ao.AntiOscillators(1.0, 1e6, [1.0], [1e3]))
except ao.InputError as error:
    print(error)
"""


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["npz", "fmu"])
def test_an_archive_on_a_full_disk_is_one_sentence(tmp_path, kind):
    done = subprocess.run(
        [sys.executable, "-c", FULL, tmp_path / "m", kind],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.stdout.startswith("cannot write")
    assert done.stderr == ""
    assert done.returncode == 0
    assert not os.listdir(tmp_path)
