"""From a regression problem to coefficients: ARX, ARMAX, ARMAXD, instrumental variables, prediction error."""
