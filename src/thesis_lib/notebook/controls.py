"""Controls for the parameters of a figure set, which rerun it and show its results.

They are for a notebook in a front end with a kernel, such as JupyterLab. Bounds and messages come
from the models of :mod:`thesis_lib.figure_sets.registry`, as for the command. In a saved file, the
controls show nothing: their output holds only a widget's view.
"""

import contextlib
import html
import json
import time
from collections.abc import Callable, Mapping, MutableMapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import ipywidgets
import xarray as xr

from thesis_lib.figure_sets.parametric.figures import error_table
from thesis_lib.figure_sets.registry import STUDIES, validate_request
from thesis_lib.notebook import show as notebook
from thesis_lib.studies import cubes, effort, request as requests

WIDE_LAYOUT = ipywidgets.Layout(width="26rem", max_width="100%", flex="0 0 auto")
MAX_SLIDER_RANGE = 720  # widest range that a slider can set


@dataclass(frozen=True)
class LiveView:
    """A widget that appears in a live front end, and leaves nothing in a file."""

    widget: ipywidgets.Widget  #: The widget to show

    def _repr_mimebundle_(self, **_: Any) -> dict[str, Any]:
        view = {"version_major": 2, "version_minor": 0, "model_id": self.widget.model_id}
        return {"text/plain": "", "application/vnd.jupyter.widget-view+json": view}


def rerun(name: str, namespace: MutableMapping[str, Any]) -> LiveView | None:
    """Return controls of a figure set for the end of its notebook.

    Parameters
    ----------
    name : str
        Name of the figure set.
    namespace : mapping
        The notebook's ``globals()``: its parameters initialise the controls, and a new cube
        becomes its ``result``, so that any cell can be run again to show it.

    Returns
    -------
    LiveView or None
        None if the notebook writes its cube to a file, since it then runs unattended.
    """
    if namespace.get("cube"):
        return None
    given = {key: namespace[key] for key in STUDIES[name].model_fields if key in namespace}
    request = validate_request(name, given)
    return LiveView(Controls(request, partial(namespace.__setitem__, "result")))


class Controls(ipywidgets.VBox):  # type: ignore[misc]  # ipywidgets has no annotations
    """Controls of a figure set, initialised with a request, and its results below.

    Parameters
    ----------
    request : Study
        A validated request.
    keep : callable
        Called with each new cube.
    """

    def __init__(
        self, request: requests.Study, keep: Callable[[xr.Dataset], object] = lambda _: None
    ) -> None:
        self.name, self.keep = request.name, keep
        self.request: requests.Study | None = None  # None if the values are refused
        self.inputs: dict[str, ipywidgets.ValueWidget] = {}  # a widget for each parameter
        self.button = ipywidgets.Button(description="Rerun", button_style="primary", icon="play")
        self.message = ipywidgets.HTML()  # the equivalent command, or the refusal
        self.output = ipywidgets.Output()  # progress and results
        known = effort.read_efforts().get(self.name)
        takes = f" Takes {known.kind}: {known.time} with the published parameters." if known else ""
        rows = [ipywidgets.HTML(f"<b>Rerun {html.escape(request.title)}</b>.{takes}")]
        values, model = request.model_dump(mode="json"), type(request)
        schemas = model.model_json_schema()["properties"]
        for row in requests.describe_parameters(model):  # in the order of the tables
            name = row["name"]
            if name == "cube":
                continue
            widget = self.inputs[name] = _build_input(schemas[name], values[name])
            widget.description = name
            widget.tooltip = f"{row['meaning']}; {row['allowed']}"
            widget.layout, widget.style.description_width = WIDE_LAYOUT, "11rem"
            widget.observe(self.check_values, "value")
            unit = f"{row['unit']}; " if row["unit"] else ""
            about = ipywidgets.HTML(html.escape(unit + row["meaning"]))
            rows.append(ipywidgets.HBox([widget, about]))
        self.button.on_click(self.run_request)
        self.check_values()
        super().__init__([*rows, self.button, self.message, self.output])

    @property
    def values(self) -> dict[str, Any]:
        """Return the plain values of the inputs; a text is parsed as JSON if possible."""
        values: dict[str, Any] = {}
        for name, widget in self.inputs.items():
            values[name] = list(widget.value) if isinstance(widget.value, tuple) else widget.value
            if isinstance(widget, ipywidgets.Text):
                with contextlib.suppress(ValueError, RecursionError):
                    values[name] = json.loads(widget.value)
        return values

    def check_values(self, _: object = None) -> None:
        """Show the command for the values, or why they are refused."""
        self.request = None
        try:
            self.request = validate_request(self.name, self.values)
            command = html.escape(requests.study_command(self.request))
            self.message.value = f"The same by command: <code>{command}</code>"
        except requests.ParameterError as error:
            self.message.value = f'<span role="alert">{html.escape(str(error))}</span>'
        self.button.disabled = self.request is None

    def run_request(self, _: object = None) -> None:
        """Run the request of the values and show its result: changes, the viewer, the table."""
        if self.request is None:
            return
        output, self.button.disabled = self.output, True
        output.outputs = ()
        known = effort.read_efforts().get(self.name)
        takes = f", about {known.time}" if known else ""
        output.append_stdout(f"running {self.name}{takes} …\n")
        start = time.perf_counter()
        try:
            cube = notebook.cube_of(self.request)
            self.keep(cube)
            seconds = time.perf_counter() - start
            output.append_stdout(f"done in {seconds:.1f} s; the new cube is `result`\n\n")
            output.append_stdout("\n".join(cubes.difference_lines(cube)) + "\n")
            if cubes.list_dimension(cube):
                output.append_display_data(cubes.summarise_errors(cube))
            else:
                output.append_display_data(LiveView(notebook.viewer(cube)))
                output.append_display_data(error_table(cube))
        except Exception as error:  # a kernel does not show errors of button callbacks
            output.append_stderr(f"{type(error).__name__}: {error}\n")
        finally:
            self.button.disabled = False


def _build_input(schema: Mapping[str, Any], value: Any) -> ipywidgets.ValueWidget:
    """Return the widget for a JSON schema: choices, a slider between bounds, else text."""
    low = schema.get("minimum", schema.get("exclusiveMinimum"))
    high = schema.get("maximum", schema.get("exclusiveMaximum"))
    if "enum" in schema:
        return ipywidgets.Dropdown(options=schema["enum"], value=value)
    if options := schema.get("items", {}).get("enum"):
        return ipywidgets.SelectMultiple(options=options, value=tuple(value), rows=len(options))
    bounded = schema.get("type") == "number" and None not in (low, high)
    if bounded and high - low <= MAX_SLIDER_RANGE:
        step = 1.0 if high - low > 100 else 0.5 if high - low > 10 else 0.01
        return ipywidgets.FloatSlider(
            value=value,
            step=step,
            readout_format=".4g",
            continuous_update=False,
            min=min(low + step * ("exclusiveMinimum" in schema), value),  # else the value moves
            max=max(high - step * ("exclusiveMaximum" in schema), value),
        )
    if not isinstance(value, str):
        value = json.dumps(requests.whole_numbers(value), ensure_ascii=False)
    return ipywidgets.Text(value=value, continuous_update=False)
