from .dask_executor import DaskExecutor as DaskExecutor
