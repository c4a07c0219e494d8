"""Sites as GeoJSON, in metres of the site's frame, and back.

GeoJSON's coordinates are degrees of longitude and latitude unless both sides agree on something else (RFC 7946,
Section 4): a file says in its member `vsnbench` that it is in metres, and one that does not is refused.
"""

import json
from typing import Any, NoReturn

from vsnbench.errors import SiteError
from vsnbench.exchange.site_features import HEAD, KINDS, MOST_FEATURES, Content, Feature, features_of, head_of
from vsnbench.protocol.site import Site

MEMBER = "vsnbench"
KIND = "kind"
_CLOSED = {"Polygon": True, "LineString": False, "Point": False}


def site_geojson(site: Site) -> str:
    """Return a site as a FeatureCollection, one feature a line."""
    member = {**head_of(site), "units": "metres", "frame": "x to the right, y up, headings in degrees from x to y"}
    features = ",\n".join(json.dumps(_written(feature), ensure_ascii=False) for feature in features_of(site))
    head = json.dumps(member, ensure_ascii=False)
    return f'{{"type": "FeatureCollection",\n"{MEMBER}": {head},\n"features": [\n{features}\n]}}\n'


def read_geojson(text: str, origin: str, metres_per_unit: float | None) -> tuple[list[Feature], Content]:
    """Return what is drawn in a FeatureCollection, and what it says of the site as a whole.

    Args:
        text: the file's content.
        origin: names the file in errors.
        metres_per_unit: what one unit of its coordinates is; None takes the file's word.

    Raises:
        SiteError: it is none, or not in metres.
    """
    try:
        content = json.loads(text, parse_constant=_no_number)
    except (ValueError, RecursionError) as problem:
        raise SiteError(f"{origin} is no JSON: {str(problem)[:100]}") from problem
    features = content.get("features") if isinstance(content, dict) else None
    if not isinstance(content, dict) or content.get("type") != "FeatureCollection" or not isinstance(features, list):
        raise SiteError(f"{origin} is no GeoJSON FeatureCollection")
    if len(features) > MOST_FEATURES:
        raise SiteError(f"{origin} has {len(features):,} features, more than {MOST_FEATURES:,}")
    member = content.get(MEMBER)
    member = member if isinstance(member, dict) else {}
    if metres_per_unit is None and member.get("units") != "metres":
        raise SiteError(
            f"{origin} does not say that it is in metres, and GeoJSON's own coordinates are degrees of longitude and "
            "latitude",
            advice="bring it into a frame in metres; then say --metres-per-unit 1",
        )
    scale = 1.0 if metres_per_unit is None else metres_per_unit
    read = [_read(feature, f"feature {place}", origin, scale) for place, feature in enumerate(features, 1)]
    _refuse_degrees(content.get("crs"), origin)
    return read, {name: member[name] for name in HEAD if name in member}


def _written(feature: Feature) -> Content:
    points = [list(point) for point in feature.points]
    geometry: Content = {"type": "LineString", "coordinates": points}
    if feature.closed:
        geometry = {"type": "Polygon", "coordinates": [[*points, points[0]]]}
    elif len(points) == 1:
        geometry = {"type": "Point", "coordinates": points[0]}
    return {"type": "Feature", "properties": {KIND: feature.kind, **feature.properties}, "geometry": geometry}


def _read(feature: Any, where: str, origin: str, scale: float) -> Feature:
    def refuse(problem: str, advice: str = "") -> NoReturn:
        raise SiteError(f"{origin}: {where}: {problem}", advice=advice)

    properties = feature.get("properties") if isinstance(feature, dict) else None
    geometry = feature.get("geometry") if isinstance(feature, dict) else None
    if not isinstance(properties, dict) or not isinstance(geometry, dict):
        refuse("it has no properties or no geometry")
    given = {name: value for name, value in properties.items() if value is not None}  # merged layers are full of null
    kind = given.pop(KIND, None)
    if not isinstance(kind, str) or kind not in KINDS:
        refuse(f"its property kind is {str(kind)[:40]!r}", f"write one of {', '.join(KINDS)}")
    shape, coordinates = geometry.get("type"), geometry.get("coordinates")
    if shape not in _CLOSED:
        refuse(f"a {str(shape)[:40]} is not read", "draw a Polygon, a LineString or a Point")
    if shape == "Polygon":
        if not isinstance(coordinates, list) or len(coordinates) != 1:
            refuse("a Polygon has one ring here, and no holes")
        coordinates = coordinates[0]
    pairs = [coordinates] if shape == "Point" else coordinates
    if not isinstance(pairs, list) or not all(_is_position(pair) for pair in pairs):
        refuse("its coordinates are no pairs of numbers")
    points = tuple((float(x) * scale, float(y) * scale) for x, y, *_ in pairs)
    if shape == "Polygon" and len(points) > 1 and points[0] == points[-1]:
        points = points[:-1]
    if len(points) < {"Polygon": 3, "LineString": 2}.get(shape, 1):
        refuse(f"a {shape} of {len(points)} points")
    name = next((str(given[key])[:40] for key in ("name", "id", "number") if key in given), "")
    return Feature(kind, points, _CLOSED[shape], given, f"{where} ({kind}{f' {name}' if name else ''})")


def _is_position(pair: object) -> bool:
    return (
        isinstance(pair, list)
        and 2 <= len(pair) <= 4
        and all(isinstance(each, int | float) and not isinstance(each, bool) and abs(each) < 1e9 for each in pair)
    )


def _refuse_degrees(crs: object, origin: str) -> None:
    name = json.dumps(crs)
    if any(word in name for word in ("CRS84", "4326")):
        raise SiteError(
            f"{origin} says that its coordinates are degrees of longitude and latitude (WGS 84)",
            advice="bring it into a frame in metres first",
        )


def _no_number(name: str) -> NoReturn:
    raise ValueError(f"{name} is no number")
