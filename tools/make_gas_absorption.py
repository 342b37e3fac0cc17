"""Make src/openswim/fluxes/data/gas_absorption.csv: absorption by water vapour, ozone and mixed gases.

The table is that of the simple spectral model of Bird and Riordan (1984, SERI/TR-215-2436), a report of the US
government in the public domain; the wheel of pvlib carries it:

    pip download --no-deps pvlib
    python tools/make_gas_absorption.py pvlib-*.whl
"""

import ast
import re
import sys
import zipfile
from pathlib import Path

TARGET = Path(__file__).parents[1] / "src/openswim/fluxes/data/gas_absorption.csv"
COLUMNS = ("wavelength", "water_vapor_absorption", "ozone_absorption", "mixed_absorption")


def main(wheel: str) -> None:
    source = zipfile.ZipFile(wheel).read("pvlib/spectrum/spectrl2.py").decode()
    lists = []
    for name in COLUMNS:
        found = re.search(rf"_SPECTRL2_COEFFS\['{name}'\] = (\[.*?\])", source, re.DOTALL)
        if found is None:
            raise SystemExit(f"{wheel}: no table {name}")
        lists.append(ast.literal_eval(re.sub(r"#.*", "", found.group(1))))
    lines = [
        "# Absorption coefficients of water vapour (1/cm), ozone (1/atm-cm) and uniformly mixed gases",
        "# Bird and Riordan (1984), SERI/TR-215-2436, public domain; made by tools/make_gas_absorption.py",
        "wavelength_nm,water_vapour,ozone,mixed_gases",
    ]
    lines += [",".join(f"{value:g}" for value in row) for row in zip(*lists, strict=True)]
    TARGET.write_text("\n".join(lines) + "\n")
    print(f"{TARGET}: {len(lists[0])} wavelengths")


if __name__ == "__main__":
    main(sys.argv[1])
