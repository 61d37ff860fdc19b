# A character that walks by the clips of a repertoire. Set `speed` and `turn` from your own script;
# the character reaches them within `seconds`, as far as its walks do.
extends CharacterBody3D

const Repertoire = preload("repertoire.gd")

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

var repertoire: Repertoire
var tree: AnimationTree
var place = Vector2.ZERO  # in the blend space
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
	var root = repertoire.blend_tree(player) if player else null
	if root == null:
		refuse(repertoire.error if player else repertoire.file + ": has no animation")
		return
	tree = AnimationTree.new()
	tree.tree_root = root
	tree.callback_mode_process = AnimationMixer.ANIMATION_CALLBACK_MODE_PROCESS_PHYSICS
	add_child(tree)
	tree.anim_player = tree.get_path_to(player)
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


func refuse(why: String):
	push_error(why)
	set_physics_process(false)


func _physics_process(delta: float):
	if by_keys:
		read_keys()
	place = place.move_toward(repertoire.nearest(turn, speed), delta / seconds)
	place = repertoire.nearest(place.x * repertoire.largest.x, place.y * repertoire.largest.y)
	tree.set("parameters/walk/blend_position", place)
	tree.set("parameters/pace/scale", repertoire.pace(repertoire.weights(place)))
	var reached = place * repertoire.largest
	rotate_y(deg_to_rad(reached.x) * delta)
	var ahead = global_basis.z.normalized() * reached.y
	velocity = Vector3(ahead.x, velocity.y - gravity * delta, ahead.z)
	move_and_slide()


func read_keys():
	speed = repertoire.largest.y * Input.get_action_strength("ui_up")
	turn = repertoire.largest.x * Input.get_axis("ui_right", "ui_left")
