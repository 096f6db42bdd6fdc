//! Base law and apparatus combined into a forward model.
