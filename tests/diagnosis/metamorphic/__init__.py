"""The same recordings told otherwise: other units, another order, fewer samples; the answer must not change."""
