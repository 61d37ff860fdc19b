# A repertoire: the table that `mjxgait repertoire` writes, and its clips as a blend space.
#
# Places in the blend space are (turn, speed), each over its largest value, so that triangles are not
# slivers. Within a triangle Godot blends clips by the same weights that `weights` returns.
extends RefCounted

const SCHEMA = 1
const LOOP = "-loop"

var error = ""
var file = ""
var clips = []  # dictionaries of the table
var largest = Vector2.ONE  # deg/s, m/s
var points = PackedVector2Array()
var triangles = PackedInt32Array()
var rim = PackedVector2Array()


# Reads the table. If it cannot be used, `error` says why.
func _init(path: String):
	var text = FileAccess.get_file_as_string(path)
	var table = JSON.parse_string(text) if text else null
	if not table is Dictionary or not table.has("clips"):
		error = "%s: not a repertoire.json of mjxgait" % path
	elif int(table.get("schema", 0)) != SCHEMA:
		error = "%s: of schema %s; this add-on reads %d" % [path, table.get("schema"), SCHEMA]
	elif table.get("root_motion", false):
		error = "%s: its clips move their root; make it without --travelling" % path
	else:
		file = path.get_base_dir().path_join(table["file"])
		clips = table["clips"]
		_place()


func _place():
	largest = Vector2.ZERO
	for clip in clips:
		largest = largest.max(place_of(clip).abs())
	var straight = is_zero_approx(largest.x)
	largest = largest.max(Vector2(1e-6, 1e-6))
	for clip in clips:
		points.append(place_of(clip) / largest)
	if straight:  # points in a line have no triangles, so each clip is in two places
		for i in clips.size():
			clips.append(clips[i])
			points.append(points[i] + Vector2.RIGHT)
	triangles = Geometry2D.triangulate_delaunay(points)
	rim = Geometry2D.convex_hull(points)


static func place_of(clip: Dictionary) -> Vector2:
	return Vector2(clip["turn"], clip["speed"])


# The nearest place to (turn, speed) that the clips reach, in the blend space.
func nearest(turn: float, speed: float) -> Vector2:
	var wanted = (Vector2(turn, speed) / largest).clamp(-Vector2.ONE, Vector2.ONE)
	if Geometry2D.is_point_in_polygon(wanted, rim):
		return wanted
	var best = points[0]
	for i in rim.size() - 1:  # the last point is the first
		var near = Geometry2D.get_closest_point_to_segment(wanted, rim[i], rim[i + 1])
		if near.distance_squared_to(wanted) < best.distance_squared_to(wanted):
			best = near
	return best


# Share of each clip at a place of the blend space: that of the triangle which holds it.
func weights(place: Vector2) -> PackedFloat32Array:
	var found = PackedFloat32Array()
	found.resize(points.size())
	var best = -INF
	for t in range(0, triangles.size(), 3):
		var corners = [triangles[t], triangles[t + 1], triangles[t + 2]]
		var shares = _shares(place, corners)
		var least = shares[shares.min_axis_index()]
		if least > best:
			best = least
			found.fill(0.0)
			for i in 3:
				found[corners[i]] = clampf(shares[i], 0.0, 1.0)
	return found


# Barycentric coordinates of a place in a triangle.
func _shares(place: Vector2, corners: Array) -> Vector3:
	var a = points[corners[0]]
	var b = points[corners[1]] - a
	var c = points[corners[2]] - a
	var area = b.cross(c)
	if is_zero_approx(area):
		return Vector3(-INF, 0.0, 0.0)
	var second = (place - a).cross(c) / area
	var third = b.cross(place - a) / area
	return Vector3(1.0 - second - third, second, third)


# Cycles per second at which feet do not slide: the speed over the length of the blended stride.
func pace(shares: PackedFloat32Array) -> float:
	var stride = 0.0
	var speed = 0.0
	var seconds = 0.0
	for i in clips.size():
		stride += shares[i] * clips[i]["speed"] * clips[i]["duration"]
		speed += shares[i] * clips[i]["speed"]
		seconds += shares[i] * clips[i]["duration"]
	return speed / stride if stride > 1e-6 else 1.0 / seconds


# The animation of a clip; Godot's importer takes the ending from the name.
func animation_of(clip: Dictionary, player: AnimationPlayer) -> String:
	var name = clip.get("animation", clip["name"])
	return name if player.has_animation(name) else name.trim_suffix(LOOP)


# A blend tree: all clips in one phase, one cycle per second, and a factor on that pace behind.
# Returns null and sets `error` if the file lacks a clip.
func blend_tree(player: AnimationPlayer) -> AnimationNodeBlendTree:
	var space = AnimationNodeBlendSpace2D.new()
	space.auto_triangles = false
	space.min_space = Vector2(-1.0, minf(points[0].y, -1.0))
	space.max_space = Vector2.ONE
	space.sync = true
	for i in clips.size():
		var node = AnimationNodeAnimation.new()
		node.animation = animation_of(clips[i], player)
		if not player.has_animation(node.animation):
			error = "%s: has no animation %s" % [file, node.animation]
			return null
		player.get_animation(node.animation).loop_mode = Animation.LOOP_LINEAR
		node.use_custom_timeline = true
		node.stretch_time_scale = true
		node.timeline_length = 1.0
		node.loop_mode = Animation.LOOP_LINEAR
		space.add_blend_point(node, points[i])
	for t in range(0, triangles.size(), 3):
		space.add_triangle(triangles[t], triangles[t + 1], triangles[t + 2])
	var tree = AnimationNodeBlendTree.new()
	tree.add_node("walk", space)
	tree.add_node("pace", AnimationNodeTimeScale.new())
	tree.connect_node("pace", 0, "walk")
	tree.connect_node("output", 0, "pace")
	return tree
