"""Virtual scans: rooms whose truth is known, scanned with rays and written in the files of real scans."""

from s2a.homes.sample.sample import RoomKind, SampleConfig, sample

__all__ = ["RoomKind", "SampleConfig", "sample"]
