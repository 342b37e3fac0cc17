"""Phase functions: mean 1, positive, and moments that agree with independent quadrature."""

import csv
import json
import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import eval_legendre

from openswim.errors import UserError
from openswim.optics.aerosol import aerosol_type, spectral_phase
from openswim.optics.hydrometeors import HYDROMETEORS, phase_function
from openswim.scene.phase import (
    AlbersDHG,
    DoubleHenyeyGreenstein,
    HenyeyGreenstein,
    Mixture,
    Rayleigh,
    TablePhase,
    phase_from_dict,
    phases_at,
)

SHARED = Path(os.environ.get("OPENSWIM_SHARED", Path(__file__).parents[3] / "shared"))

G = st.floats(-0.98, 0.98)
SMOOTH = st.one_of(
    G.map(HenyeyGreenstein),
    st.builds(AlbersDHG, G, st.floats(0, 1.4)),
    st.builds(Rayleigh, st.floats(0, 0.9)),
    st.builds(DoubleHenyeyGreenstein, G, G, st.floats(0, 1)),
)


def quadrature_moments(phase, n):
    """Composite Gauss-Legendre in angle, dense at both ends: knows nothing of the implementation."""
    edges = np.concatenate([[0.0], np.geomspace(1e-7, np.pi / 2, 800)])
    edges = np.concatenate([edges, np.pi - edges[-2::-1]])
    node, weight = np.polynomial.legendre.leggauss(20)
    half = np.diff(edges)[:, None] / 2
    theta = (edges[:-1, None] + half * (1 + node)).ravel()
    integrand = (half * weight).ravel() * np.sin(theta) * phase.value(np.cos(theta)) / 2
    return np.polynomial.legendre.legvander(np.cos(theta), n - 1).T @ integrand


@given(SMOOTH)
def test_moments_and_positivity(phase):
    moments = phase.moments(8)
    np.testing.assert_allclose(moments, quadrature_moments(phase, 8), atol=2e-6)
    assert moments[0] == pytest.approx(1.0, abs=1e-12)
    assert phase.asymmetry == pytest.approx(moments[1])
    assert (phase.value(np.linspace(-1, 1, 181)) > 0).all()


@given(SMOOTH)
def test_saves_as_json(phase):
    assert phase_from_dict(json.loads(json.dumps(phase.to_dict()))) == phase


def test_known_values():
    assert HenyeyGreenstein(0.85).value(1.0) == pytest.approx(1.85 / 0.15**2)
    assert HenyeyGreenstein(0.0).value(0.3) == 1
    assert Rayleigh(0.0).value(1.0) == pytest.approx(1.5)
    assert Rayleigh(0.0).moments(4)[2] == pytest.approx(0.1)


def test_albers_dhg_keeps_the_asymmetry_of_its_g():
    """Only with the corrected Eq. 27 are mean and mean cosine 1 and g."""
    np.testing.assert_allclose(AlbersDHG(0.7, 0.4).moments(2), [1, 0.7], rtol=1e-12)


@pytest.mark.parametrize(
    ("name", "asymmetry"), [("continental", 0.65), ("colorado_dust", 0.636), ("saudi_dust_pollution", 0.62)]
)
def test_aerosol_types_have_the_errata_asymmetry(name, asymmetry):
    (phase,) = spectral_phase(aerosol_type(name), 546.0)
    assert phase.asymmetry == pytest.approx(asymmetry, abs=0.005)
    np.testing.assert_allclose(phase.moments(6), quadrature_moments(phase, 6), atol=1e-6)


def test_table_reproduces_an_analytic_function():
    hg = HenyeyGreenstein(0.9)
    angle = np.concatenate([[0], np.geomspace(0.01, 180, 3000)])
    table = TablePhase(angle, 7.0 * hg.value(np.cos(np.radians(angle))))
    np.testing.assert_allclose(table.moments(60), hg.moments(60), atol=2e-6)
    mu = np.linspace(-1, 1, 301)
    np.testing.assert_allclose(table.value(mu), hg.value(mu), rtol=2e-4)


def test_moments_of_a_table_are_exact():
    """To rounding, however long the series and the table: between its angles quadrature converges."""
    random = np.random.default_rng(5)
    for count in (2, 9, 1200):
        inner = np.sort(random.uniform(0.1, 179.9, count - 2))
        table = TablePhase(np.concatenate([[0.0], inner, [180.0]]), np.exp(random.uniform(-2, 8, count)))
        edges = np.unique(np.concatenate([table.angle_deg, np.linspace(0, 180, 801)]))
        node, weight = np.polynomial.legendre.leggauss(12)
        half = np.radians(np.diff(edges))[:, None] / 2
        theta = (np.radians(edges[:-1, None]) + half * (1 + node)).ravel()
        cosine = np.cos(theta)
        integrand = (half * weight).ravel() * np.sin(theta) * table.value(cosine) / 2
        moments = np.array([(eval_legendre(ell, cosine) * integrand).sum() for ell in (0, 1, 2, 50, 899)])
        np.testing.assert_allclose(table.moments(900)[[0, 1, 2, 50, 899]], moments, atol=1e-11)


def test_table_takes_descending_angles():
    up, down = TablePhase([0, 90, 180], [3, 1, 2]), TablePhase([180, 90, 0], [2, 1, 3])
    assert up == down
    assert up.moments(1)[0] == pytest.approx(1)


@pytest.mark.parametrize(
    "case", ["cloud_r10_546", "cloud_r6_546", "aer_CapeVerde_546", "aer_FineUrbanGSFC_546"]
)
def test_table_on_sharp_mie_peaks(case):
    """Asymmetry of the reference Mie functions from their tables (peak/mean up to 7500)."""
    folder = SHARED / "reference" / "clearsky"
    if not folder.exists():
        pytest.skip(f"no {folder}")
    truth = json.loads((folder / "mie_phase.json").read_text())["cases"][case]
    with (folder / "mie_phase.csv").open() as file:
        rows = [(row["scat_angle_deg"], row["P"]) for row in csv.DictReader(file) if row["case"] == case]
    angle, value = np.array(rows, float).T
    table = TablePhase(angle, value)
    assert table.asymmetry == pytest.approx(truth["g"], abs=5e-5)
    np.testing.assert_allclose(table.moments(700)[:400], quadrature_moments(table, 400), atol=1e-5)


@pytest.mark.parametrize("kind", list(HYDROMETEORS))
@pytest.mark.parametrize("wavelength_nm", [450.0, 520.0, 615.0])
def test_hydrometeors_are_normalised_and_positive(kind, wavelength_nm):
    phase = phase_function(kind, wavelength_nm)
    moments = quadrature_moments(phase, 4)
    np.testing.assert_allclose(moments, phase.moments(4), atol=1e-5)
    assert (phase.value(np.cos(np.radians(np.linspace(0, 180, 721)))) > 0).all()
    expected = {"liquid": 0.863, "rain": 0.884, "ice": 0.80, "snow": 0.874, "graupel": 0.57}[kind]
    assert phase.asymmetry == pytest.approx(expected, abs=0.005)


def test_interpolates_between_wavelengths():
    low, high = HenyeyGreenstein(0.6), HenyeyGreenstein(0.7)
    g = [p.asymmetry for p in phases_at({600.0: high, 500.0: low}, [400, 500, 525, 600, 700])]
    np.testing.assert_allclose(g, [0.6, 0.6, 0.625, 0.7, 0.7])
    assert phases_at(low, [500, 600]) == [low, low]


@pytest.mark.parametrize(
    "make",
    [
        lambda: HenyeyGreenstein(1.0),
        lambda: HenyeyGreenstein(float("nan")),
        lambda: AlbersDHG(0.5, 2.5),
        lambda: Mixture([0.5, 0.2], [HenyeyGreenstein(0.1)] * 2),
        lambda: Mixture([1.6, -0.6], [HenyeyGreenstein(0.0), HenyeyGreenstein(0.9)]),
        lambda: Mixture([], []),
        lambda: TablePhase([0, 90], [1, 1]),
        lambda: TablePhase([0, 90, 180], [1, 0, 1]),
        lambda: TablePhase([0, 90, 180], [1, np.nan, 1]),
        lambda: Rayleigh(-0.1),
        lambda: phase_from_dict({"type": "mystery"}),
    ],
)
def test_refuses_nonsense(make):
    with pytest.raises(UserError):
        make()
