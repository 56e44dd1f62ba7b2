"""Digests of what results are made by: folders of code, facts, recordings, and the lock.

A folder counts as a whole. What a product does not share with all others, it names in its
:attr:`~thesis_lib.figure_sets.figure_set.Product.rooms`.
"""

from __future__ import annotations

import hashlib
import json
from functools import cache
from importlib import import_module
from pathlib import Path

from thesis_lib.facts.setups import data_folder
from thesis_lib.figure_sets.figure_set import Product
from thesis_lib.figure_sets.registry import FIGURE_SETS
from thesis_lib.files import digest_of, folder_files, shipped
from thesis_lib.studies.lock import package_versions
from thesis_lib.studies.request import Study

PACKAGE_FOLDER = Path(__file__).parents[1]
SCIENCE_ROOMS = ("acoustics", "arrays.py", "facts", "studies", "vibration", "vision")
FACT_FILES = ("assumptions.toml", "setups.toml", "structures.toml")
LOCK_FILE = Path("requirements", "book.txt")


def source_files(product: Product) -> list[Path]:
    """Return the files of code and facts that can change a product, and the lock."""
    own = Path(import_module(product.module.rpartition(".")[0]).__path__[0])
    rooms = [PACKAGE_FOLDER / room for room in (*SCIENCE_ROOMS, *product.rooms)]
    every = sorted(data_folder().iterdir())
    facts = every if "ledger" in product.rooms else [one for one in every if one.name in FACT_FILES]
    code = [path for path in folder_files([*rooms, own]) if path.suffix == ".py"]
    return [*code, *facts, shipped() / LOCK_FILE]


@cache
def code_digest(product: Product) -> str:
    """Return the digest that a cube carries of the code, facts and packages that made it.

    It is that of the files when this process first asked, as what it has imported is, too.
    """
    own = digest_of(source_files(product))
    return hashlib.sha256(f"{own} {package_versions()}".encode()).hexdigest()


def request_key(product: Product, asked: Study) -> str:
    """Return the digest of all that determines a product for a request, inputs included."""
    needed = [request_key(*each) for each in product.needs(asked).values()]
    needed += [request_key(FIGURE_SETS[one.name], one) for one in product.reads()]
    needed += [digest_of(product.stored(asked))]
    text = json.dumps([asked.name, asked.digest, code_digest(product), *needed])
    return hashlib.sha256(text.encode()).hexdigest()
