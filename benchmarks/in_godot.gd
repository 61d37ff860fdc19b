# What Godot makes of an exported walk, and a picture of it. Run with Godot 3 (Debian: godot3), in a
# project's folder that holds project.godot and walk.glb, after the editor has imported it once
# (godot3-server --editor does it without a screen, and then stays open); under Xvfb if there is none:
#
#     godot3 -s in_godot.gd --video-driver GLES2
#
# Prints the number of bones and of each animation its seconds, tracks and whether it loops; writes
# frame.png.
extends SceneTree

const AT = 0.2  # s, of the picture
const DRAWN = 8  # frames until everything is there
var frames = 0


func _init():
	var scene = load("res://walk.glb").instance()
	var player = find(scene, "AnimationPlayer")
	print("bones ", find(scene, "Skeleton").get_bone_count())
	for name in player.get_animation_list():
		var walk = player.get_animation(name)
		print(name, ": ", walk.length, " s, ", walk.get_track_count(), " tracks, loop ", walk.loop)
	get_root().add_child(scene)
	light()
	player.play(player.get_animation_list()[0])
	player.seek(AT, true)
	player.stop(false)


func _idle(_seconds):
	frames += 1
	if frames == DRAWN:
		var image = get_root().get_texture().get_data()
		image.flip_y()
		image.save_png("res://frame.png")
		quit()
	return false


func light():
	var camera = Camera.new()
	get_root().add_child(camera)
	camera.look_at_from_position(Vector3(1.35, 0.7, 1.0), Vector3(0.0, 0.33, 0.0), Vector3.UP)
	camera.fov = 38
	camera.current = true
	var sun = DirectionalLight.new()
	get_root().add_child(sun)
	sun.look_at_from_position(Vector3(1.5, 3.0, 2.0), Vector3.ZERO, Vector3.UP)
	var world = WorldEnvironment.new()
	world.environment = Environment.new()
	world.environment.background_mode = Environment.BG_COLOR
	world.environment.background_color = Color(1, 1, 1)
	world.environment.ambient_light_color = Color(1, 1, 1)
	world.environment.ambient_light_energy = 0.5
	get_root().add_child(world)


func find(node, kind):
	if node.is_class(kind):
		return node
	for child in node.get_children():
		var found = find(child, kind)
		if found:
			return found
	return null
