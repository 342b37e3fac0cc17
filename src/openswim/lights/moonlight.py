"""How bright the moon is: sunlight from its lit side, and earthshine on the other."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from openswim.lights.moon import Moon
from openswim.lights.spectrum import solar_irradiance

F64 = NDArray[np.float64]

MEAN_SOLID_ANGLE_SR, MEAN_DISTANCE_KM = 6.4177e-5, 384_400.0
EARTH_RADIUS_KM = 6371.0
EARTH_ALBEDO = 0.20  # geometric, of a Lambertian Earth that reflects .30
WIDEST_DEG = 95.0  # phase angle to which the reflectance was measured
_SMALLEST_DEG = 0.5

# LIME (ESA, coefficients 23.01.01), the form of Kieffer & Stone 2005 (AJ 129, 2887), Eq. 10: a0-a3, b1-b3, c1-c4,
# d1-d3 at each wavelength
_WAVELENGTHS_NM = np.array([440.0, 500.0, 675.0, 870.0, 1020.0, 1640.0])
_A = np.array([
    [-2.263172432, -1.953409783, 0.691585146, -0.301894577], [-2.150477824, -1.828162868, 0.596750118, -0.279326293],
    [-1.914524626, -1.722984816, 0.562314803, -0.276204745], [-1.816469623, -1.590599221, 0.465802547, -0.248147989],
    [-1.752793600, -1.505016569, 0.401689482, -0.229885748], [-1.474382296, -1.217779712, 0.189072862, -0.168372041],
])  # fmt: skip
_B = np.array([
    [0.052456211, 0.008714468, -0.004148856], [0.050077725, 0.010694765, -0.003817844],
    [0.047094444, 0.012212050, -0.004842774], [0.046822590, 0.018782172, -0.007000712],
    [0.052411689, 0.021768424, -0.008638112], [0.047554853, 0.011998950, -0.004867793],
])  # fmt: skip
_C = np.array([
    [0.001216634, -0.000358287, 0.001610105, 0.000732067], [0.001116700, -0.000414510, 0.001779578, 0.000944686],
    [0.001112617, -0.000426178, 0.001710380, 0.000936428], [0.001153363, -0.000374185, 0.001881709, 0.000894613],
    [0.001044300, -0.000449685, 0.001817379, 0.000837371], [0.000944675, -0.000489541, 0.001732148, 0.001093331],
])  # fmt: skip
_D = np.array([
    [-0.092938476, 2.000625563, -0.005710425], [12.966528574, -12.421979227, -0.002729971],
    [9.886489331, -9.752388729, -0.005938836], [10.478132200, -10.363729899, -0.003423694],
    [11.936277597, -11.815427729, -0.002552853], [14.326729557, -14.410231212, 0.000003484],
])  # fmt: skip
_P_DEG = (1.354459689, 1.314673623, 9.324088764, 9.596769204)

# Miller & Turner 2009 (IEEE TGRS 47, 2316): lunar irradiance from 95 to 180 degrees of phase angle, every 5 degrees,
# relative to 95
_THIN_CRESCENT = np.array([
    0.348532, 0.289879, 0.233696, 0.188400, 0.146566, 0.114023, 0.0848946, 0.0632087, 0.0462609, 0.0338565, 0.0238325,
    0.0167755, 0.0115535, 0.00795684, 0.00543289, 0.00370952, 0.00255330, 0.00175778,
]) / 0.348532  # fmt: skip


def disc_reflectance(
    wavelengths_nm: ArrayLike, phase_deg: float, sub_observer_lonlat_deg: tuple[float, float] = (0.0, 0.0),
    subsolar_lon_deg: float | None = None,
) -> F64:  # fmt: skip
    """Reflectance (nw,) of the moon's whole disc: pi E_moon / (E_sun times its solid angle).

    phase_deg: from sun to observer, at the moon. subsolar_lon_deg: selenographic, positive while the moon waxes
    (None: midway between waxing and waning). LIME to 95 degrees, within 5 % of its later coefficients; from there on as
    Miller & Turner have it. The measurements end at 1.55 degrees; at most they are taken to half a degree.
    """
    measured = float(np.clip(phase_deg, _SMALLEST_DEG, WIDEST_DEG))
    g = np.radians(measured)
    sun = 0.0 if subsolar_lon_deg is None else float(np.radians(np.clip(subsolar_lon_deg, -WIDEST_DEG, WIDEST_DEG)))
    lon, lat = sub_observer_lonlat_deg
    p1, p2, p3, p4 = _P_DEG
    log = _A @ g ** np.arange(4) + _B @ sun ** np.array([1, 3, 5]) + _C @ [lat, lon, sun * lat, sun * lon]
    log = log + _D @ [np.exp(-measured / p1), np.exp(-measured / p2), np.cos((measured - p3) / p4)]
    found = np.exp(np.interp(np.asarray(wavelengths_nm, float), _WAVELENGTHS_NM, log))
    if phase_deg > WIDEST_DEG:
        angles = WIDEST_DEG + 5.0 * np.arange(len(_THIN_CRESCENT))
        found = found * np.exp(np.interp(phase_deg, angles, np.log(_THIN_CRESCENT)))
    return np.asarray(found)


def moon_irradiance(moon: Moon, wavelengths_nm: ArrayLike) -> F64:
    """Spectral irradiance (nw,) W m-2 nm-1 of a surface that faces the moon, outside of the air; to 10 %."""
    reflectance = disc_reflectance(
        wavelengths_nm, moon.phase_angle_deg, moon.sub_observer_lonlat_deg, moon.subsolar_lonlat_deg[0]
    )
    solid_angle = MEAN_SOLID_ANGLE_SR * (MEAN_DISTANCE_KM / moon.distance_km) ** 2
    sun = solar_irradiance(np.asarray(wavelengths_nm, float)) / moon.sun_distance_au**2
    return np.asarray(reflectance * solid_angle * sun / np.pi)


def earthshine(phase_deg: float, distance_km: float = MEAN_DISTANCE_KM) -> float:
    """What the Earth sends to the moon's dark side, over what the sun sends to the lit one.

    A Lambertian sphere of geometric albedo .20, seen from the moon at a phase angle of 180 degrees less the moon's own:
    5.5e-5 at new moon. Clouds change it by a third.
    """
    angle = np.pi - np.radians(phase_deg)
    lit = ((np.pi - angle) * np.cos(angle) + np.sin(angle)) / np.pi
    return float(EARTH_ALBEDO * (EARTH_RADIUS_KM / distance_km) ** 2 * lit)
