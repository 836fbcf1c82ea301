"""The experiments of the papers, on emulated boards."""
