"""Files, units and errors, keys of files, processes: what every chapter stands on, films or not."""
