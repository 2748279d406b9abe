"""Run a verb (subcommand) on many recordings: for each, a row of a table and a JSON document.

::

    sources → tasks → engine (processes or a Dask cluster) → outcomes → folder → table

A task is one verb on one recording (`task`). `run_task` runs a task and never raises: a failure is
an outcome with an exit code. `engines` distribute tasks; results do not depend on the engine, the
number of workers, or the order in which tasks end. `output_folder` stores each outcome as soon as
it arrives, and `results_table` writes the table. `analyses` defines the verbs.
"""
