"""The same recordings told otherwise: other units, another order, fewer samples. No answer may change."""
