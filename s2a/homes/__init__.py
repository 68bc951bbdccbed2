"""Virtual homes (satellite): furnished rooms whose truth is known, scanned by rays, and objects to insert.

In: a seed. Out: the files of a real scan with the truth beside them, pools of rooms, labelled objects.
"""
