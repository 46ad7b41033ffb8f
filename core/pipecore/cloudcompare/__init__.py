"""The plugin in CloudCompare, by its Python runtime.

The runtime (github.com/tmontaigu/CloudCompare-PythonRuntime) finds `plugin.PipeGUI` by the entry
point group ``cloudcompare.plugins`` and shows its actions. Detection runs in the runtime's thread,
on a view of CloudCompare's own points; what is found comes back as scalar fields of the same
clouds and as a group of surfaces, axes and labels. No window of ours opens in CloudCompare's
process: settings and app run in their own.

`pycc` and `cccorelib` are modules of the runtime that exist nowhere else.
"""
