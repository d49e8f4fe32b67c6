//! Ray-traced ground truth, and which pixels may be compared.
