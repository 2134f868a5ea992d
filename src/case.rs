//! case.json as written: SI, nothing derived.
