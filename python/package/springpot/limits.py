"""Limits of a command."""

from typing import TypedDict

__all__ = ["Limits"]


class Limits(TypedDict, total=False):
    """Limits of a command. What is left out is that of the model's board, or else of the paper's bench."""

    max_voltage_v: float
    """Largest voltage, V (6000)."""
    max_field_v_per_m: float
    """Largest electric field in the film as it thins, V/m (4.2e7)."""
    max_slew_v_per_s: float
    """Largest change of voltage, V/s (50e3)."""
    max_velocity_m_per_s: float
    """Largest speed of the shaped reference, m/s (0.05)."""
    max_acceleration_m_per_s2: float
    """Largest acceleration of the shaped reference, m/s² (0.5)."""
