"""`openswim aerosol`: named types, and fits of double Henyey-Greenstein functions to Mie theory."""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from openswim.cli.options import check_plot, tell_notes
from openswim.errors import UserError
from openswim.scene.files import check_targets, written_whole

if TYPE_CHECKING:
    from openswim.optics import DoubleHGFit, PhaseFunction


@dataclass(frozen=True)
class FitRequest:
    """What the user asked for, as the options have it."""

    modes: tuple[str, ...] = ()
    by: str | None = None
    indices: tuple[str, ...] = ()
    irregular: bool = False
    type_name: str | None = None
    aeronet: tuple[Path, ...] = ()
    time: str | None = None
    wavelengths: str = "615,546,450"
    json_path: Path | None = None
    plot_path: Path | None = None


@dataclass(frozen=True)
class _Particles:
    """Phase function and single-scattering albedo per wavelength, Angstrom exponent, effective radius."""

    phases: "list[PhaseFunction]"
    albedo: list[float]
    angstrom_exponent: float | None
    effective_radius_um: float | None


def list_types() -> None:
    """One line per named type: optical properties at 550 nm."""
    from openswim.optics.aerosol import NAMES, aerosol_type, spectral_albedo, spectral_phase

    click.echo(f"{'':22}{'albedo':>8}{'g':>8}{'Angstrom':>10}   (550 nm)")
    for name in NAMES:
        kind = aerosol_type(name)
        albedo, (phase,) = spectral_albedo(kind, 550.0)[0], spectral_phase(kind, 550.0)
        click.echo(f"{name:22}{albedo:8.3f}{phase.asymmetry:8.3f}{kind.angstrom_exponent:10.2f}")


def fit(request: FitRequest) -> None:
    """Compute, fit, print; write JSON and picture."""
    from openswim.optics import fit_double_hg

    _check_options(request)
    check_targets([("--json", request.json_path), ("--plot", request.plot_path)])
    if request.plot_path is not None:
        check_plot(request.plot_path, "mie")
    wavelengths = _numbers("--wavelengths", request.wavelengths)
    if not wavelengths or not all(200 <= wl <= 4000 for wl in wavelengths):
        raise UserError(f"--wavelengths {request.wavelengths}: give nanometres within 200 to 4000, such as 615,546,450")
    if request.aeronet:
        particles = _sunphotometer(request, wavelengths)
    else:
        particles = _named(request, wavelengths) if request.type_name else _mie(request, wavelengths)
    fits = [fit_double_hg(phase) for phase in particles.phases]
    _print(wavelengths, fits, particles)
    if request.json_path is not None:
        with written_whole(request.json_path) as partial:
            partial.write_text(json.dumps(_described(wavelengths, fits, particles), indent=1) + "\n")
    if request.plot_path is not None:
        _draw(request.plot_path, wavelengths, fits, particles)


def _check_options(request: FitRequest) -> None:
    """Raise UserError where an option would have no effect beside the others, or --json names no JSON file."""
    for name, value, own, owner in (("--by", request.by, request.modes, "--mode"),
                                    ("--time", request.time, request.aeronet, "--aeronet")):  # fmt: skip
        if value is not None and not own:
            raise UserError(f"{name} {value} belongs to {owner}: leave it out, or give {owner}")
    if request.json_path is not None and request.json_path.suffix.lower() != ".json":
        raise UserError(f"--json {request.json_path}: suffix {request.json_path.suffix!r} is unknown; use .json")


def _named(request: FitRequest, wavelengths: list[float]) -> _Particles:
    from openswim.optics.aerosol import aerosol_type, spectral_albedo, spectral_phase

    if request.modes or request.indices or request.irregular:
        raise UserError("give either --type, or --mode and --index (with --irregular or without)")
    kind = aerosol_type(str(request.type_name))
    albedo = [float(a) for a in spectral_albedo(kind, wavelengths)]
    return _Particles(spectral_phase(kind, wavelengths), albedo, kind.angstrom_exponent, None)


def _sunphotometer(request: FitRequest, wavelengths: list[float]) -> _Particles:
    """By AERONET's inversions: phase functions as retrieved, else of size distribution and refractive index."""
    import numpy as np

    from openswim.scene.phase import phases_at
    from openswim.stations.aeronet import read_aeronet

    if request.modes or request.indices or request.irregular or request.type_name:
        raise UserError("give --aeronet alone, or --type, or --mode and --index")
    found = read_aeronet(list(request.aeronet), request.time)
    tell_notes(found.notes)
    if found.spherical < 1 and not found.phase:
        share = f"{100 * (1 - found.spherical):.0f} %"
        click.echo(f"note: {share} are no spheres: taken as irregular particles, as no table of spheroids is at hand "
                   "(a .pfn file has AERONET's own)", err=True)  # fmt: skip
    if found.phase:
        phases = phases_at(found.phase, wavelengths)
        albedo = np.interp(wavelengths, *_sorted(found.albedo or {550.0: 0.95}))
    else:
        optics = [found.particles(wl) for wl in wavelengths]
        phases = [one.phase for one in optics]
        albedo = np.array([one.single_scattering_albedo for one in optics])
        if found.albedo:
            albedo = np.interp(wavelengths, *_sorted(found.albedo))
    known, depth = _sorted(found.depth)
    exponent = -float(np.polyfit(np.log(known), np.log(depth), 1)[0]) if len(known) > 1 else None
    return _Particles(phases, [float(a) for a in albedo], exponent, None)


def _sorted(by_wavelength: dict[float, float]) -> tuple[list[float], list[float]]:
    known = sorted(by_wavelength)
    return known, [by_wavelength[wl] for wl in known]


def _mie(request: FitRequest, wavelengths: list[float]) -> _Particles:
    import numpy as np

    from openswim.optics.spheres import Mode, lognormal_sizes, scattering_by_spheres

    if not request.modes or not request.indices:
        raise UserError("give at least one --mode and one --index, or a --type; openswim aerosol fit --help shows how")
    modes = []
    for text in request.modes:
        numbers = _numbers("--mode", text)
        if len(numbers) not in (2, 3):
            raise UserError(f"--mode {text}: give RADIUS,STD or RADIUS,STD,AMOUNT, such as 0.1,1.6,1")
        modes.append(Mode(numbers[0], numbers[1], numbers[2] if len(numbers) == 3 else 1.0, request.by or "number"))
    sizes = lognormal_sizes(modes)
    indices = _indices(request.indices, wavelengths)
    found = [
        scattering_by_spheres(sizes, index, wl, irregular=request.irregular)
        for wl, index in zip(wavelengths, indices, strict=True)
    ]
    exponent = None
    if len(set(wavelengths)) > 1:
        exponent = -float(np.polyfit(np.log(wavelengths), np.log([one.efficiency for one in found]), 1)[0])
    albedo = [float(one.single_scattering_albedo) for one in found]
    return _Particles([one.phase for one in found], albedo, exponent, sizes.effective_radius_um)


def _numbers(option: str, text: str) -> list[float]:
    try:
        return [float(part) for part in text.split(",") if part.strip()]
    except ValueError:
        raise UserError(f"{option} {text}: not a list of numbers divided by commas") from None


def _indices(texts: tuple[str, ...], wavelengths: list[float]) -> list[complex]:
    """Refractive index at each wavelength, linear between those given; its imaginary part absorbs with either sign."""
    import numpy as np

    given: dict[float, complex] = {}
    for text in texts:
        place, _, value = text.rpartition(":")
        try:
            index = complex(value.replace(" ", "").replace("i", "j"))
            given[float(place) if place else 0.0] = index
            if not np.isfinite([index, *given]).all():
                raise ValueError(text)
        except ValueError:
            raise UserError(f"--index {text}: give N+Ki or WAVELENGTH:N+Ki, such as 440:1.56+0.003i") from None
    if len(given) != len(texts) or (0.0 in given and len(given) > 1):
        raise UserError("--index: give one for all wavelengths, or several with a different wavelength each")
    known = sorted(given)
    beyond = [wl for wl in wavelengths if 0.0 not in given and not known[0] <= wl <= known[-1]]
    if beyond:
        click.echo(f"note: --index says nothing of {_listed(beyond)} nm, which lie beyond {_listed(known)} nm: the "
                   "nearest is taken", err=True)  # fmt: skip
    real = np.interp(wavelengths, known, [given[wl].real for wl in known])
    absorbing = np.interp(wavelengths, known, [abs(given[wl].imag) for wl in known])
    return [complex(n, k) for n, k in zip(real, absorbing, strict=True)]


def _listed(values: Sequence[float]) -> str:
    return ", ".join(f"{value:g}" for value in values)


def _print(wavelengths: list[float], fits: "list[DoubleHGFit]", particles: _Particles) -> None:
    head = f"{'nm':>6}{'g_1':>8}{'g_2':>8}{'f_c':>8}{'f_b':>8}{'rms ln':>9}{'g':>8}{'g error':>9}{'albedo':>9}"
    click.echo(head)
    for wl, one, albedo in zip(wavelengths, fits, particles.albedo, strict=True):
        click.echo(
            f"{wl:6g}{one.sharp_g:8.3f}{one.broad_g:8.3f}{one.sharp_fraction:8.3f}{one.f_b:8.3f}"
            f"{one.error:9.3f}{one.asymmetry:8.3f}{one.asymmetry_error:+9.4f}{albedo:9.4f}"
        )
    if particles.effective_radius_um is not None:
        click.echo(f"effective radius {particles.effective_radius_um:.3g} um")
    if particles.angstrom_exponent is not None:
        click.echo(f"Angstrom exponent {particles.angstrom_exponent:.2f}")


def _described(wavelengths: list[float], fits: "list[DoubleHGFit]", particles: _Particles) -> dict[str, Any]:
    """Everything found; "aerosol" is what `AerosolProfile.from_dict` takes."""
    return {
        "wavelength_nm": wavelengths,
        "fits": [asdict(one) for one in fits],
        "single_scattering_albedo": particles.albedo,
        "angstrom_exponent": particles.angstrom_exponent,
        "effective_radius_um": particles.effective_radius_um,
        "aerosol": {
            "angstrom_exponent": particles.angstrom_exponent or 0.0,
            "single_scattering_albedo": dict(zip(map(str, wavelengths), particles.albedo, strict=True)),
            "phase": {"spectral": {str(wl): one.phase.to_dict() for wl, one in zip(wavelengths, fits, strict=True)}},
        },
    }


def _draw(path: Path, wavelengths: list[float], fits: "list[DoubleHGFit]", particles: _Particles) -> None:
    """Phase functions, their fits, and the ratio below."""
    import numpy as np
    from matplotlib.figure import Figure

    angle = np.concatenate([np.geomspace(0.5, 10, 60), np.arange(10.5, 180.1, 0.5)])
    mu = np.cos(np.radians(angle))
    figure = Figure(figsize=(7, 6), layout="constrained")
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1))
    for wl, one, phase in zip(wavelengths, fits, particles.phases, strict=True):
        red, blue = np.clip([(wl - 440) / 190, (620 - wl) / 190], 0, 1)  # as the light itself
        colour = (red, 0.6 * np.exp(-(((wl - 545) / 45) ** 2)), blue)
        exact, fitted = phase.value(mu), one.phase.value(mu)
        above.semilogy(angle, exact, color=colour, label=f"{wl:g} nm")
        above.semilogy(angle, fitted, color=colour, linestyle="--", linewidth=1)
        below.plot(angle, fitted / exact, color=colour, linewidth=1)
    above.set_ylabel("phase function (mean 1)")
    above.legend(title="solid: particles, dashed: fit")
    below.axhline(1.0, color="0.5", linewidth=0.5)
    below.set(xlabel="scattering angle (degrees)", ylabel="fit / particles", xlim=(0, 180))
    with written_whole(path) as partial:
        figure.savefig(partial, dpi=150)
