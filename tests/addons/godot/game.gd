# Drives the walker straight on, slowly in a curve, sharply to the right, and to a stand. Prints what it
# did as JSON.
extends Node3D

const STEPS = 60  # of physics per second
const ASKED = [[0.9, 0.0], [0.25, 5.0], [0.5, -500.0], [0.0, 0.0]]  # of the largest speed; deg/s
const LONG = 2.0  # s of each

@onready var walker = $Walker
var step = 0
var told = {"parts": []}
var last = {}
var begun = {}
var slid = 0.0
var gone = 0.0
var poses = []
var steps = {}


func _ready():
	add_shape(WorldBoundaryShape3D.new(), StaticBody3D.new(), self)
	var ball = SphereShape3D.new()
	ball.radius = 0.1
	add_shape(ball, walker, null).position.y = 0.1
	set_scene()
	told["version"] = Engine.get_version_info()["string"]
	told["error"] = walker.repertoire.error
	walker.footstep.connect(func(foot): steps[foot] = steps.get(foot, 0) + 1)
	if walker.tree == null:
		finish()


func add_shape(shape: Shape3D, body: Node, parent: Node) -> Node3D:
	var holder = CollisionShape3D.new()
	holder.shape = shape
	body.add_child(holder)
	if parent:
		parent.add_child(body)
	return holder


func _physics_process(_delta):
	if walker.tree == null or step > ASKED.size() * LONG * STEPS:
		return
	var part = int(step / (LONG * STEPS))
	if step % int(LONG * STEPS) == 0:
		if step:
			told["parts"].append(report())
		begin()
		if part < ASKED.size():
			walker.speed = ASKED[part][0] * walker.repertoire.largest.y
			walker.turn = ASKED[part][1]
	step += 1
	if step > ASKED.size() * LONG * STEPS:
		finish()
	elif step % int(LONG * STEPS) > STEPS:
		measure()
	if step == int(LONG * STEPS * 1.9):
		print("picture")


func begin():
	begun = {}
	last = {}
	slid = 0.0
	gone = 0.0
	poses = []
	steps = {}


# How far the lowest bone of the feet slides, and how far the body goes, once it walks evenly.
func measure():
	var skeleton = walker.find_children("*", "Skeleton3D", true, false)[0]
	var lowest = -1
	var places = {}
	for i in skeleton.get_bone_count():
		places[i] = skeleton.global_transform * skeleton.get_bone_global_pose(i).origin
		if i > 0 and (lowest < 0 or places[i].y < places[lowest].y):
			lowest = i  # bone 0 is the root on the floor
	poses.append(skeleton.get_bone_pose_rotation(3))
	if last and last["lowest"] == lowest:
		var moved = places[lowest] - last["places"][lowest]
		slid += Vector2(moved.x, moved.z).length()
		gone += (walker.position - last["at"]).length()
	if begun.is_empty():
		begun = {"at": walker.position, "yaw": walker.rotation.y, "step": step}
	last = {"lowest": lowest, "places": places, "at": walker.position}


func report() -> Dictionary:
	var seconds = float(step - 1 - begun["step"]) / STEPS
	var way = walker.position - begun["at"]
	var most = 0.0
	for pose in poses:
		most = maxf(most, pose.angle_to(poses[0]))
	return {
		"asked": [walker.turn, walker.speed],
		"speed": way.length() / seconds,
		"ahead": way.dot(walker.global_basis.z),
		"turn": rad_to_deg(angle_difference(begun["yaw"], walker.rotation.y)) / seconds,
		"reached": [walker.place.x * walker.repertoire.largest.x,
			walker.place.y * walker.repertoire.largest.y],
		"on_floor": walker.is_on_floor(),
		"pace": walker.tree.get("parameters/pace/scale"),
		"bone_turned": most,
		"steps": steps,
		"slid": slid / gone if gone > 0.01 else 0.0,
	}


func finish():
	print("told " + JSON.stringify(told))
	if OS.get_name() != "Web":
		get_tree().quit()


func set_scene():
	var camera = Camera3D.new()
	walker.add_child(camera)
	camera.look_at_from_position(Vector3(1.1, 0.6, 1.0), Vector3(0.0, 0.32, 0.0))
	camera.fov = 50.0
	var sun = DirectionalLight3D.new()
	add_child(sun)
	sun.look_at_from_position(Vector3(1.5, 3.0, 2.0), Vector3.ZERO)
	var ground = MeshInstance3D.new()
	ground.mesh = PlaneMesh.new()
	ground.mesh.size = Vector2(40, 40)
	ground.mesh.material = StandardMaterial3D.new()
	ground.mesh.material.albedo_color = Color(0.62, 0.66, 0.6)
	add_child(ground)
	for i in range(-20, 21):
		var rung = MeshInstance3D.new()
		rung.mesh = BoxMesh.new()
		rung.mesh.size = Vector3(3, 0.004, 0.03)
		rung.position.z = 0.5 * i
		add_child(rung)
