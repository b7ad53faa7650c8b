"""Files of measurements: kinds, signs and units of universal files, tables, and hostile ones."""

from __future__ import annotations

import tracemalloc
import zipfile
from pathlib import Path

import numpy as np
import pytest

import antiosc as ao

F = np.arange(1, 65) * 10.0
IW = 2j * np.pi * F
H = 1 / (1e6 + 30 * IW + 0.1 * IW**2)
KINDS = {"receptance": (8, "m", 0), "mobility": (11, "m/s", 1), "accelerance": (12, "m/s**2", 2)}


def written(path: Path, *sets: dict) -> Path:
    pyuff = pytest.importorskip("pyuff")
    pyuff.UFF(str(path)).write_sets(list(sets), "add")
    return path


def function(values, response=(12, 3), reference=(12, 3), data=12, label="m/s^2", **more) -> dict:
    pyuff = pytest.importorskip("pyuff")
    made = pyuff.prepare_58(
        binary=more.get("binary", 0), func_type=more.get("func_type", 4), rsp_node=response[0],
        rsp_dir=response[1], ref_node=reference[0], ref_dir=reference[1], data=values, x=F,
        ordinate_spec_data_type=data, orddenom_spec_data_type=more.get("denominator", 13),
        num_pts=F.size, rsp_ent_name=more.get("name", "NONE"), abscissa_spacing=1,
        abscissa_min=F[0], abscissa_inc=F[1] - F[0], abscissa_spec_data_type=18, id1="a",
        ordinate_axis_units_lab=label, orddenom_axis_units_lab=more.get("below", "N"),
        return_full_dict=True,
    )  # fmt: skip
    words = ("id1", "id2", "id3", "id4", "id5", "lab", "name")
    empty = {key: "NONE" if any(word in key for word in words) else 0 for key in made}
    return {key: empty[key] if value is None else value for key, value in made.items()}


@pytest.mark.parametrize("quantity", KINDS)
@pytest.mark.filterwarnings(
    "ignore::pytest.PytestUnraisableExceptionWarning"
)  # pyuff leaves files open
@pytest.mark.parametrize("binary", [0, 1])
def test_kinds_of_universal_files(quantity, binary, tmp_path):
    data, label, power = KINDS[quantity]
    path = written(
        tmp_path / "a.uff", function(H * IW**power, data=data, label=label, binary=binary)
    )
    frf = ao.read_frf(path)
    assert frf.quantity == quantity
    assert np.allclose(frf.receptance, H, rtol=1e-6)


@pytest.mark.parametrize(
    ("label", "below", "factor"),
    [
        ("mm/s^2", "N", 1e-3),
        ("g", "N", 9.80665),
        ("(m/s2)/kN", "NONE", 1e-3),
        ("m/s2", "mN", 1e3),
        ("m/s2", "MN", 1e-6),
        ("NONE", "NONE", 1.0),
    ],
)
def test_units_by_their_labels(label, below, factor, tmp_path):
    path = written(tmp_path / "a.uff", function(H * IW**2 / factor, label=label, below=below))
    assert np.allclose(ao.read_frf(path).receptance, H, rtol=1e-6)


def test_units_of_data_set_164_and_of_the_caller(tmp_path):
    pyuff = pytest.importorskip("pyuff")
    units = pyuff.prepare_164(
        units_code=5, units_description="mm", temp_mode=1, length=1e3, force=1e3, temp=1.0,
        temp_offset=0.0, return_full_dict=True,
    )  # fmt: skip
    one = function(H * IW**2, label="NONE", below="NONE")  # mm per mN is m per N
    assert np.allclose(
        ao.read_frf(written(tmp_path / "a.uff", units, one)).receptance, H, rtol=1e-6
    )
    strange = written(tmp_path / "b.uff", function(H * IW**2, label="V"))
    with pytest.raises(ao.InputError, match=r"unit.*V / N"):
        ao.read_frf(strange)
    assert np.allclose(ao.read_frf(strange, unit=2.0).receptance, 2 * H, rtol=1e-6)


def test_signs_of_directions_sites_and_coherence(tmp_path):
    path = written(
        tmp_path / "a.uff",
        function(-H * IW**2, response=(12, -3), name="eye"),
        function(2 * H * IW**2, response=(7, 3), reference=(12, 3)),
        function(np.full(F.size, 0.9), response=(12, -3), func_type=6, name="eye"),
    )
    with pytest.raises(ao.InputError, match="driving"):
        ao.read_frf(path)  # "eye" is the response's name alone
    path = written(
        tmp_path / "b.uff",
        function(-H * IW**2, response=(12, -3)),
        function(2 * H * IW**2, response=(7, 3), reference=(12, 3)),
        function(np.full(F.size, 0.9) + 0j, response=(12, -3), func_type=6),
    )
    frf = ao.read_frf(path)
    assert np.allclose(frf.receptance, H, rtol=1e-6)
    assert np.allclose(frf.coherence, 0.9)
    assert np.allclose(ao.read_frf(path, "12z").receptance, H, rtol=1e-6)
    two = ao.read_frf(path, {"tip": 12, "heel": "7"})
    assert two.sites == ("tip", "heel")
    assert two.references == ("tip",)
    assert np.allclose(two.receptance[:, 1, 0], 2 * H, rtol=1e-6)
    with pytest.raises(ao.InputError, match="12z"):
        ao.read_frf(path, "eye")


def test_universal_files_that_are_damaged(tmp_path):
    whole = written(tmp_path / "a.uff", function(H * IW**2)).read_bytes()
    for i, content in enumerate(
        (b"", b"no file", whole[: len(whole) // 2], whole[:400], whole.replace(b"58", b"15"),
         whole.replace(b"        64", b"    640000"), bytes(range(256)) * 50)
    ):  # fmt: skip
        path = tmp_path / f"bad{i}.uff"
        path.write_bytes(content)
        with pytest.raises(ao.InputError) as error:
            ao.read_frf(path)
        assert "\n" not in str(error.value)
    per_motion = written(tmp_path / "t.uff", function(H, denominator=12))
    with pytest.raises(ao.InputError, match="force"):
        ao.read_frf(per_motion)
    turning = written(tmp_path / "r.uff", function(H, response=(1, 4), reference=(1, 4)))
    with pytest.raises(ao.InputError, match="rotations"):
        ao.read_frf(turning)


def table(path: Path, header: str, *columns: np.ndarray) -> Path:
    rows = [",".join(f"{value:.12e}" for value in row) for row in zip(*columns, strict=True)]
    path.write_text("\n".join([header, *rows]))
    return path


ACCELERANCE = H * IW**2


@pytest.mark.parametrize(
    ("header", "columns"),
    [
        ("frequency [kHz], real [m/s²/N], imag [m/s²/N]",
         (F / 1e3, ACCELERANCE.real, ACCELERANCE.imag)),
        ("frequency (rad/s), real, imag", (2 * np.pi * F, ACCELERANCE.real, ACCELERANCE.imag)),
        ("frequency [Hz], real [(mm/s^2)/N], imag [mm/s**2/N]",
         (F, 1e3 * ACCELERANCE.real, 1e3 * ACCELERANCE.imag)),
    ],
)  # fmt: skip
def test_units_in_headers_are_read(header, columns, tmp_path):
    path = table(tmp_path / "a.csv", header, *columns)
    frf = ao.read_frf(path, quantity="accelerance")
    assert np.allclose(frf.receptance, H, rtol=1e-6)
    assert np.allclose(frf.frequency, F)


@pytest.mark.parametrize(
    "header",
    [
        "frequency [furlong], real, imag", "frequency, magnitude [dB], phase",
        "frequency, real [V/N], imag [V/N]", "x [kHz], y [m/N], z [m/N]",
        "frequency [Mhz], real, imag", "frequency; real; imag",
    ],
)  # fmt: skip
def test_a_unit_that_is_not_known_is_refused(header, tmp_path):
    path = table(tmp_path / "a.csv", header, F, H.real, H.imag)
    with pytest.raises(ao.InputError, match=r"unit|column"):
        ao.read_frf(path, quantity="receptance")


@pytest.mark.parametrize("header", ["time [ms],force [kN]", "Time (ms), Force (kN)"])
def test_a_history_in_other_units_is_that_in_si(hit, header, tmp_path):
    t = np.linspace(0.0, 2.5e-3, 501)
    rows = np.column_stack([1e3 * t, 1e-3 * hit.force_at(t)])
    path = tmp_path / "a.csv"
    np.savetxt(path, rows, header=header, comments="", delimiter=",", fmt="%.12e")
    assert ao.compare(hit, path).scale == pytest.approx(1.0, rel=1e-3)
    path.write_text(path.read_text().replace("kN", "kV"))
    with pytest.raises(ao.InputError, match=r"unit|columns"):
        ao.compare(hit, path)


def test_arrays_in_a_file(tmp_path):
    path = tmp_path / "a.npz"
    np.savez(path, frequency=F, values=H * IW, quantity="mobility", coherence=np.full(F.size, 0.8))
    frf = ao.read_frf(path)
    assert np.allclose(frf.receptance, H)
    path.write_bytes(path.read_bytes()[:300])
    with pytest.raises(ao.InputError, match="NumPy"):
        ao.read_frf(path)
    with pytest.raises(ao.InputError, match="no regular file"):
        ao.read_frf(tmp_path / "none.npz")


@pytest.mark.slow
def test_an_archive_that_unpacks_to_much_more_is_refused_before(tmp_path):
    path = tmp_path / "a.npz"
    shape = {"descr": "<f8", "fortran_order": False, "shape": (16_000_000,)}
    with (
        zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive,
        archive.open("frequency.npy", "w", force_zip64=True) as member,
    ):
        np.lib.format.write_array_header_1_0(member, shape)
        for _ in range(128):
            member.write(bytes(1_000_000))
    assert path.stat().st_size < 1_000_000
    tracemalloc.start()
    with pytest.raises(ao.InputError, match="at most"):
        ao.read_frf(path, quantity="mobility")
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert most < 10_000_000


@pytest.mark.parametrize(
    "arrays",
    [
        {"frequency": F, "values": np.full(F.size, "x")},
        {"frequency": F, "real": np.full(F.size, "x"), "imag": F},
        {"frequency": F, "real": F, "imag": F[:3]},
        {"frequency": F, "magnitude": F, "phase": np.full(F.size, "x")},
        {"frequency": F, "magnitude": np.full((3, 3), "a"), "phase": F},
        {"frequency": F, "values": H, "sigma": np.full(F.size, "x")},
        {"frequency": F + 1j, "values": H},
        {"frequency": F, "values": H, "quantity": np.array(["a", "b"])},
        {"frequency": F, "values": H, "coherence": np.array("x")},
    ],
)
def test_arrays_that_are_no_measurement_are_refused(arrays, tmp_path):
    np.savez(tmp_path / "a.npz", **{"quantity": "mobility", **arrays})
    with pytest.raises(ao.InputError):
        ao.read_frf(tmp_path / "a.npz")


@pytest.mark.parametrize(
    "content",
    ["", "f, re, im\n", "1, 2, 3\n2, 3\n", "1, 2, 3\nx, y, z\n", "a, b\n1, 2\n", "1 2\n" * 20],
)
def test_tables_that_are_damaged(content, tmp_path):
    path = tmp_path / "a.csv"
    path.write_text(content)
    with pytest.raises(ao.InputError):
        ao.read_frf(path, quantity="mobility")


@pytest.fixture(scope="module")
def hit() -> ao.History:
    model = ao.AntiOscillators(m0=0.02, k0=1e6, m=[0.1], omega=[2000.0])
    return ao.simulate(model, ao.RigidMass(0.1, velocity=1.0), ao.Hertz(1e9), duration=3e-3)


@pytest.mark.slow
def test_shift_and_scale_come_back(hit, tmp_path):
    t = np.linspace(0.0, 2.5e-3, 1001)
    path = tmp_path / "measured.csv"
    rows = np.column_stack([t + 0.7123, 1.1 * hit.force_at(t)])
    np.savetxt(path, rows, header="time (s), force (N)", delimiter=",", fmt="%.12e")
    found = ao.compare(hit, path)
    assert found.shift == pytest.approx(-0.7123, abs=1e-6)
    assert found.scale == pytest.approx(1.1, rel=1e-3)
    assert pytest.approx(0.1, rel=0.02) == found.L2
    assert found.scaled_L2 < 2e-3
    assert found.peak == pytest.approx(0.1, abs=1e-3)
    assert found.impulse == pytest.approx(0.1, abs=1e-3)
    assert found.plot(tmp_path / "over.png").is_file()


@pytest.mark.parametrize(
    "measured",
    [
        ([0.0, 1.0], [0.0, 1.0]),
        (np.arange(9.0), -np.ones(9)),
        (np.zeros(9), np.ones(9)),
        "none.csv",
    ],
)
def test_what_is_no_measured_force(hit, measured):
    with pytest.raises(ao.InputError):
        ao.compare(hit, measured)
