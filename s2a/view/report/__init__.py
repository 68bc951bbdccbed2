"""Results as one self-contained page: runs, sweeps, evaluations, studies, validation reports."""
