"""Run a verb (subcommand) on many recordings; write a table row and a JSON document for each.

::

    sources → tasks → engine (processes or a Dask cluster) → outcomes → folder → table

A task is one verb on one recording (`task`). `run_task` runs a task and never raises an exception:
a failure is an outcome with an exit code. `engines` distribute the tasks. The results depend
neither on the engine, nor on the number of workers, nor on the order in which tasks end.
`output_folder` stores each outcome as soon as it arrives, and `results_table` writes the table.
`analyses` defines the verbs.
"""
