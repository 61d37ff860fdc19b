# A character that walks by the clips of a repertoire. Set `speed` and `turn` from your own script;
# the character reaches them within `seconds`, as far as its walks do. Where the repertoire has a
# start and a stop, it starts and stops by them.
extends CharacterBody3D

## A foot comes down: the name of its bone. For dust and sound.
signal footstep(foot: String)

const Repertoire = preload("repertoire.gd")
const STANDS = 1e-3  # in the blend space; nearer to its origin it stands

## The table beside the GLB, as `mjxgait repertoire` writes both.
@export_file("*.json") var table: String
## Metres per second ahead.
@export var speed = 0.0
## Degrees per second to the left.
@export var turn = 0.0
## Time in which it goes from rest to its fastest walk.
@export_range(0.05, 3.0, 0.05) var seconds = 0.6
## Arrow keys (ui_up, ui_left, ui_right) set speed and turn.
@export var by_keys = true
## Starts and stops of the repertoire are played. Otherwise it blends between idle and walks.
@export var by_ways = true

var repertoire: Repertoire
var tree: AnimationTree
var skeleton: Skeleton3D
var place = Vector2.ZERO  # in the blend space
var phase = 0.0  # of the walk's cycle, 0 to 1
var leads = ""  # name of the clip of which footfalls count
var way = {}  # the start or stop that is played
var left = 0.0  # s of it that remain
var gravity: float = ProjectSettings.get_setting("physics/3d/default_gravity", 9.8)


func _ready():
	repertoire = Repertoire.new(table)
	var body = null if repertoire.error else scene_of(repertoire.file)
	if body == null:
		refuse(repertoire.error if repertoire.error else repertoire.file + ": cannot be read")
		return
	add_child(body)
	var players = body.find_children("*", "AnimationPlayer", true, false)
	var player = players[0] if players else null
	var root_bone = track_of_root(body, player) if player else NodePath()
	var root = repertoire.blend_tree(player, root_bone) if player else null
	if root == null:
		refuse(repertoire.error if player else repertoire.file + ": has no animation")
		return
	repertoire.add_footfalls(player, player.get_node(player.root_node).get_path_to(self), "_footfall")
	tree = AnimationTree.new()
	tree.tree_root = root
	tree.callback_mode_process = AnimationMixer.ANIMATION_CALLBACK_MODE_PROCESS_PHYSICS
	add_child(tree)
	tree.anim_player = tree.get_path_to(player)
	if repertoire.ways:
		tree.root_motion_track = root_bone
	tree.active = true


# The clips as a scene: as the editor imported them or, outside of the project, as they are.
static func scene_of(file: String) -> Node:
	if ResourceLoader.exists(file):
		return load(file).instantiate()
	var document = GLTFDocument.new()
	var state = GLTFState.new()
	if document.append_from_file(file, state) != OK:
		return null
	return document.generate_scene(state)


# The track of the first bone, which starts and stops move.
func track_of_root(body: Node, player: AnimationPlayer) -> NodePath:
	var skeletons = body.find_children("*", "Skeleton3D", true, false)
	if skeletons.is_empty():
		return NodePath()
	skeleton = skeletons[0]
	var above = player.get_node(player.root_node).get_path_to(skeleton)
	return NodePath("%s:%s" % [above, skeleton.get_bone_name(0)])


func refuse(why: String):
	push_error(why)
	set_physics_process(false)


func _physics_process(delta: float):
	if by_keys:
		read_keys()
	if left > 0.0:
		_go_on(delta)
	else:
		_approach(delta)
	var shares = repertoire.weights(place)
	var pace = repertoire.pace(shares)
	leads = way["name"] if left > 0.0 else repertoire.leading(shares)
	phase = fposmod(phase + pace * delta, 1.0)
	tree.set("parameters/walk/blend_position", place)
	tree.set("parameters/pace/scale", pace)
	_move(delta)


# Takes the blend towards the wanted one, or begins a start or stop.
func _approach(delta: float):
	var target = repertoire.nearest(turn, speed)
	if by_ways and repertoire.ways:
		var stands = place.length() < STANDS
		if stands and speed > 0.0 and target.length() >= STANDS:
			var clip = repertoire.nearest_with_way(speed, false)
			if clip:
				_begin(repertoire.way_of(clip, false))
				return
		if not stands and target.length() < STANDS:
			var clip = repertoire.nearest_with_way(place.y * repertoire.largest.y, true)
			if clip:  # a stop begins where the walk's cycle does
				target = Repertoire.place_of(clip) / repertoire.largest
				if place.distance_to(target) < STANDS and phase + delta / clip["duration"] >= 1.0:
					_begin(repertoire.way_of(clip, true))
					return
	place = place.move_toward(target, delta / seconds)
	place = repertoire.nearest(place.x * repertoire.largest.x, place.y * repertoire.largest.y)


func _begin(chosen: Dictionary):
	way = chosen
	left = way["duration"]
	var player = tree.get_node(tree.anim_player)
	tree.tree_root.get_node("way").animation = repertoire.animation_of(way, player)
	tree.set("parameters/once/request", AnimationNodeOneShot.ONE_SHOT_REQUEST_FIRE)


# A start or stop goes on. Below it the walk stands, or is in phase where it is blended with.
func _go_on(delta: float):
	left -= delta
	if way["to"] == Repertoire.IDLE:
		if way["duration"] - left > Repertoire.FADE:
			place = Vector2.ZERO
	elif left <= Repertoire.FADE and place.length() < STANDS:
		for clip in repertoire.clips:
			if clip["name"] == way["to"]:
				place = Repertoire.place_of(clip) / repertoire.largest
				phase = fposmod(-left / clip["duration"], 1.0)
		tree.set("parameters/seek/seek_request", phase)


func _move(delta: float):
	var reached = place * repertoire.largest
	var share = 0.0  # of a start or stop in the blend
	if left > 0.0:
		share = clampf(minf(way["duration"] - left, left) / Repertoire.FADE, 0.0, 1.0)
	rotate_y(deg_to_rad(reached.x) * (1.0 - share) * delta)
	var ahead = global_basis.z.normalized() * reached.y * (1.0 - share)
	if left > 0.0:  # as the root moved, which is blended already
		ahead += skeleton.global_basis * tree.get_root_motion_position() / delta
	velocity = Vector3(ahead.x, velocity.y - gravity * delta, ahead.z)
	move_and_slide()


# Called by the animations. Of clips that are blended the one with the largest share counts.
func _footfall(clip: String, foot: String):
	if clip == leads:
		footstep.emit(foot)


func read_keys():
	speed = repertoire.largest.y * Input.get_action_strength("ui_up")
	turn = repertoire.largest.x * Input.get_axis("ui_right", "ui_left")
