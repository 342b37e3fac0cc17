"""The paper's own estimate of light in clouds (Albers et al. 2020, Eqs 4-23 and 32-34)."""
