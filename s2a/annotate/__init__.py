"""Annotating a bare scan: regions grown from clicks, joints, handles, proposals, and the page on which that is done."""
