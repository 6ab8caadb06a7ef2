"""Make `docs/compare.schema.json` from the models of a comparison: ``python docs/make_compare_schema.py``."""

from __future__ import annotations

import json
from pathlib import Path

from warp_caustics import Comparison

TARGET = Path(__file__).parent / "compare.schema.json"

if __name__ == "__main__":
    schema = Comparison.model_json_schema(mode="serialization")
    TARGET.write_text(json.dumps(schema, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    print(TARGET)
