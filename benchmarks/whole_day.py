"""The zenith and the light on the ground at every minute of a day, at three places: see benchmarks/README.md."""

import argparse
import json
import sys
import time

import numpy as np

from openswim.lights.units import magnitude_of_radiance
from openswim.validation.night.whole_day import Skies, steps

# place, and a day without eclipses: of long dusks, of a polar spring with both, and of the tropics with a full moon
DAYS = {
    "Innsbruck": (47.3, 11.4, "2024-06-21"),
    "Longyearbyen": (78.2, 15.6, "2024-03-08"),
    "Nairobi": (-1.3, 36.8, "2024-01-25"),
}
MOST_MAG, MOST_CHANGE_MAG = 0.45, 0.1


def main() -> int:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("places", nargs="*", default=list(DAYS), help=", ".join(DAYS))
    options.add_argument("--every", type=int, default=1, help="minutes; bounds hold for 1")
    options.add_argument("--json", help="keep the series here")
    chosen = options.parse_args()
    kept, fine = {}, True
    for name in chosen.places:
        lat, lon, day = DAYS[name]
        started = time.perf_counter()
        skies = Skies.over(lat, lon)
        minutes = np.datetime64(day, "m") + np.arange(0, 1440, chosen.every)
        zenith, lux = np.array([skies.at(minute) for minute in minutes]).T
        step, change = steps(zenith)
        good = bool(np.isfinite(zenith).all() and np.isfinite(lux).all() and zenith.min() > 0 and lux.min() > 0)
        good &= bool(step.max() < MOST_MAG and change.max() < MOST_CHANGE_MAG)
        fine &= good
        bright = magnitude_of_radiance(zenith)
        print(
            f"{name} {day}: zenith {bright.min():.2f} to {bright.max():.2f} mag/arcsec2, "
            f"{lux.max():.4g} to {lux.min():.4g} lx; steps up to {step.max():.3f} mag at "
            f"{minutes[step.argmax()]}, changing by {change.max():.3f} at {minutes[change.argmax() + 1]}; "
            f"{time.perf_counter() - started:.0f} s: {'good' if good else 'NOT GOOD'}", flush=True,
        )  # fmt: skip
        kept[name] = {"time": minutes.astype(str).tolist(), "zenith": zenith.tolist(), "lux": lux.tolist()}
    if chosen.json:
        with open(chosen.json, "w", encoding="utf-8") as stream:
            json.dump(kept, stream)
    return 0 if fine else 1


if __name__ == "__main__":
    sys.exit(main())
