"""What QGIS reads of flights: run by a Python that has QGIS, which is seldom that of the tests.

    python3 qgis_layers.py PICTURE FIRST SECONDS FILE..

Prints the layers as JSON, with how many of their features are shown from a moment on, and draws
them as a PNG in the colours that the files state.
"""

import json
import os
import sys
from pathlib import Path

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")

from qgis.core import (
    Qgis,
    QgsApplication,
    QgsCoordinateReferenceSystem,
    QgsCoordinateTransformContext,
    QgsDateTimeRange,
    QgsFeatureRequest,
    QgsLineSymbolLayer,
    QgsMapRendererSequentialJob,
    QgsMapSettings,
    QgsProject,
    QgsProperty,
    QgsProviderRegistry,
    QgsProviderSublayerDetails,
    QgsSymbolLayer,
    QgsVectorLayer,
    QgsVectorLayerTemporalContext,
    QgsWkbTypes,
)
from qgis.PyQt.QtCore import QDateTime, QSize, Qt

_TABLE = "?type=csv&xField=longitude&yField=latitude&zField={z}&crs=EPSG:4326&detectTypes=yes"
_COLOURS = {
    QgsSymbolLayer.PropertyStrokeColor: 'coalesce("stroke", "marker-color")',
    QgsSymbolLayer.PropertyFillColor: 'coalesce("fill", "marker-color")',
}
_OPACITY = 0.3  # of areas


def layers_of(path: Path) -> list[QgsVectorLayer]:
    """Returns the layers that QGIS offers for a file, with Z from the heights of a table."""
    if path.suffix == ".csv":
        head = path.read_text().partition("\n")[0].split(",")
        z = "above_sea" if "above_sea" in head else "above_ellipsoid"
        address = path.resolve().as_uri() + _TABLE.format(z=z)
        return [QgsVectorLayer(address, path.name, "delimitedtext")]
    found = QgsProviderRegistry.instance().querySublayers(
        str(path), Qgis.SublayerQueryFlag.ResolveGeometryType
    )
    options = QgsProviderSublayerDetails.LayerOptions(QgsCoordinateTransformContext())
    return [details.toLayer(options) for details in found]


def value_of(value: object) -> object:
    """Returns a value that JSON has; moments in UTC."""
    if isinstance(value, QDateTime):
        return value.toUTC().toString(Qt.ISODateWithMs) if value.isValid() else None
    return value if isinstance(value, str | int | float | list | dict) else None


def told(layer: QgsVectorLayer, path: Path) -> dict[str, object]:
    """Returns what a layer is, and its features."""
    names = layer.fields().names()
    box = layer.extent()
    return {
        "file": path.name,
        "name": layer.name(),
        "valid": layer.isValid(),
        "kind": QgsWkbTypes.displayString(layer.wkbType()),
        "crs": layer.crs().authid(),
        "box": [box.xMinimum(), box.yMinimum(), box.xMaximum(), box.yMaximum()],
        "types": {field.name(): field.typeName() for field in layer.fields()},
        "features": [
            {
                "values": dict(zip(names, map(value_of, feature.attributes()), strict=True)),
                "points": [
                    [at.x(), at.y(), at.z() if at.is3D() else None]
                    for at in feature.geometry().vertices()
                ],
            }
            for feature in layer.getFeatures()
        ],
    }


def shown(layer: QgsVectorLayer, first: str, seconds: float) -> int | None:
    """Returns how many features a layer shows of some seconds, by its times; None without any."""
    names, times = layer.fields().names(), layer.temporalProperties()
    if "begin" in names:
        times.setMode(times.ModeFeatureDateTimeStartAndEndFromFields)
        times.setStartField("begin")
        times.setEndField("end")
    elif "time" in names:
        times.setMode(times.ModeFeatureDateTimeInstantFromField)
        times.setStartField("time")
    else:
        return None
    times.setIsActive(True)
    begin = QDateTime.fromString(first, Qt.ISODate)
    span = QgsDateTimeRange(begin, begin.addMSecs(round(1000 * seconds)), True, False)
    context = QgsVectorLayerTemporalContext()
    context.setLayer(layer)
    request = QgsFeatureRequest().setFilterExpression(times.createFilterString(context, span))
    times.setIsActive(False)
    return len(list(layer.getFeatures(request)))


def draw(layers: list[QgsVectorLayer], picture: str) -> None:
    """Draws layers into a PNG, lines above areas, in the colours of their features."""
    for layer in layers:
        if "stroke" in layer.fields().names():
            part = layer.renderer().symbol().symbolLayer(0)
            for key, words in _COLOURS.items():
                part.setDataDefinedProperty(key, QgsProperty.fromExpression(words))
            if isinstance(part, QgsLineSymbolLayer):
                part.setWidth(1.0)
        if layer.geometryType() == QgsWkbTypes.PolygonGeometry:
            layer.setOpacity(_OPACITY)
    settings = QgsMapSettings()
    settings.setLayers(sorted(layers, key=lambda layer: layer.geometryType()))
    settings.setOutputSize(QSize(900, 900))
    settings.setDestinationCrs(QgsCoordinateReferenceSystem("EPSG:3857"))
    settings.setTransformContext(QgsProject.instance().transformContext())
    extent = settings.fullExtent()
    extent.scale(1.05)
    settings.setExtent(extent)
    job = QgsMapRendererSequentialJob(settings)
    job.start()
    job.waitForFinished()
    if not job.renderedImage().save(picture):
        raise SystemExit(f"{picture}: not written")


def tell(picture: str, first: str, seconds: str, *paths: str) -> None:
    """Prints all layers of all files, with what is shown of some seconds, and draws them."""
    found = [(layer, Path(path)) for path in paths for layer in layers_of(Path(path))]
    layers = [
        told(layer, path) | {"shown": shown(layer, first, float(seconds))} for layer, path in found
    ]
    json.dump({"version": Qgis.version(), "layers": layers}, sys.stdout)
    draw([layer for layer, _ in found], picture)


if __name__ == "__main__":
    QgsApplication.setPrefixPath("/usr", True)
    application = QgsApplication([], False)
    application.initQgis()
    tell(*sys.argv[1:])  # its layers are gone before QGIS ends
    application.exitQgis()
