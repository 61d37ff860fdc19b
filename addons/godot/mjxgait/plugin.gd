# Adds the node MjxgaitWalker to the editor's list.
@tool
extends EditorPlugin


func _enter_tree():
	add_custom_type("MjxgaitWalker", "CharacterBody3D", preload("walker.gd"), null)


func _exit_tree():
	remove_custom_type("MjxgaitWalker")
