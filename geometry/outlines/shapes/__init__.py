"""The registered shapes of frames, plates and electrodes, one file each."""
