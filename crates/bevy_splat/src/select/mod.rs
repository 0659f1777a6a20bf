//! Messages that change what is selected.
