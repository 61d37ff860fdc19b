# A repertoire: the table that `mjxgait repertoire` writes, and its clips as a blend space.
#
# Places in the blend space are (turn, speed), each over its largest value, so that triangles are
# not slivers. Within a triangle Godot blends clips by the same weights that `weights` returns.
extends RefCounted

const SCHEMA = 1
const LOOP = "-loop"
const IDLE = "idle"
const FADE = 0.1  # s between a walk and a start or stop

var error = ""
var file = ""
var clips = []  # dictionaries of the table
var ways = []  # starts and stops of the table that were found
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
		for way in table.get("transitions", []):
			if way.get("found", false):
				ways.append(way)
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


# The start to a walk, or the stop from it; an empty one if it has none.
func way_of(clip: Dictionary, stops: bool) -> Dictionary:
	for way in ways:
		var ends = [way["to"], way["from"]] if stops else [way["from"], way["to"]]
		if ends == [IDLE, clip["name"]]:
			return way
	return {}


# The walk with a start, or with a stop, that is nearest to a speed; an empty one without any.
func nearest_with_way(wanted: float, stops: bool) -> Dictionary:
	var best = {}
	for clip in clips:
		if way_of(clip, stops).is_empty():
			continue
		if best.is_empty() or absf(clip["speed"] - wanted) < absf(best["speed"] - wanted):
			best = clip
	return best


# The clip with the largest share.
func leading(shares: PackedFloat32Array) -> String:
	var most = 0
	for i in shares.size():
		if shares[i] > shares[most]:
			most = i
	return clips[most]["name"]


# Gives all animations a track that calls `method(clip, foot)` at footfalls, on the node at `path`.
func add_footfalls(player: AnimationPlayer, path: NodePath, method: String):
	for clip in clips + ways:
		var animation = player.get_animation(animation_of(clip, player))
		if animation.find_track(path, Animation.TYPE_METHOD) >= 0:
			continue  # of another character with the same file, or of the same clip
		var track = animation.add_track(Animation.TYPE_METHOD)
		animation.track_set_path(track, path)
		for fall in clip.get("contacts", []):
			var key = {"method": method, "args": [clip["name"], fall["foot"]]}
			animation.track_insert_key(track, minf(fall["down"], animation.length), key)


# The animation of a clip; Godot's importer takes the ending from the name.
func animation_of(clip: Dictionary, player: AnimationPlayer) -> String:
	var name = clip.get("animation", clip["name"])
	return name if player.has_animation(name) else name.trim_suffix(LOOP)


# A blend tree: all clips in one phase, one cycle per second, and a factor on that pace behind.
# Returns null and sets `error` if the file lacks a clip. root: track of the bone that starts and
# stops move.
func blend_tree(player: AnimationPlayer, root: NodePath) -> AnimationNodeBlendTree:
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
	tree.add_node("seek", AnimationNodeTimeSeek.new())
	tree.connect_node("seek", 0, "walk")
	tree.add_node("pace", AnimationNodeTimeScale.new())
	tree.connect_node("pace", 0, "seek")
	_add_ways(tree, player, root)
	return tree


# Starts and stops are played once, over the walk: "way" is the motion, "once" plays it. Those that
# do not move the root are left out, for they would leave the character's body behind.
func _add_ways(tree: AnimationNodeBlendTree, player: AnimationPlayer, root: NodePath):
	var moving = []
	for one in ways:
		var name = animation_of(one, player)
		if not player.has_animation(name):
			continue
		if player.get_animation(name).find_track(root, Animation.TYPE_POSITION_3D) >= 0:
			moving.append(one)
	ways = moving
	if ways.is_empty():
		tree.connect_node("output", 0, "pace")
		return
	var once = AnimationNodeOneShot.new()
	once.fadein_time = FADE
	once.fadeout_time = FADE
	var way = AnimationNodeAnimation.new()
	way.animation = animation_of(ways[0], player)
	tree.add_node("way", way)
	tree.add_node("once", once)
	tree.connect_node("once", 0, "pace")
	tree.connect_node("once", 1, "way")
	tree.connect_node("output", 0, "once")
