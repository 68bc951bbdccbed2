"""Handles by shape: bars, knobs, sheets, and the room for fingers behind them."""
