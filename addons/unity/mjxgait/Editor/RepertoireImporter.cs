// UNTRIED: no Unity has compiled or run this script; it follows the manual of Unity 2022.3 and of the
// package glTFast (com.unity.cloud.gltfast), which imports the GLB.
//
// Put repertoire.glb and repertoire.json beside each other into Assets. In the GLB's import settings
// choose Animation > Mecanim. The script writes repertoire.controller beside them:
// - the state "walk", a blend tree of all clips by the parameters `turn` (deg/s to the right, for
//   Unity turns to the right as the yaw grows) and `speed` (m/s);
// - a state for each start and stop, which goes on to "walk" by itself: Animator.CrossFade(name, 0.1f);
// - at each footfall an event Footstep(string foot), which your script beside the Animator receives.
// A controller that exists is left as it is; delete it to build it again.
using System;
using System.Collections.Generic;
using System.IO;
using System.Linq;
using UnityEditor;
using UnityEditor.Animations;
using UnityEngine;

namespace Mjxgait
{
    public class RepertoireImporter : AssetPostprocessor
    {
        const int Schema = 1;
        const float Fade = 0.1f; // s

        [Serializable]
        class Contact { public string foot; public float down; public float up; }

        [Serializable]
        class Clip
        {
            public string name, animation;
            public float speed, turn, duration;
            public int strides;
            public bool found; // of starts and stops
            public Contact[] contacts;
            public string Animation => string.IsNullOrEmpty(animation) ? name : animation;
        }

        [Serializable]
        class Table
        {
            public int schema;
            public string file;
            public Clip[] clips, transitions;
        }

        static void OnPostprocessAllAssets(
            string[] imported, string[] deleted, string[] moved, string[] movedFrom)
        {
            var folders = imported
                .Where(path => path.EndsWith("repertoire.json") || path.EndsWith("repertoire.glb"))
                .Select(path => Path.GetDirectoryName(path).Replace('\\', '/'))
                .Distinct();
            foreach (var folder in folders.ToArray()) Build(folder);
        }

        static void Build(string folder)
        {
            string file = folder + "/repertoire.json", target = folder + "/repertoire.controller";
            if (!File.Exists(file) || File.Exists(target)) return;
            var table = JsonUtility.FromJson<Table>(File.ReadAllText(file));
            if (table == null || table.schema != Schema || table.clips == null)
            {
                Debug.LogError(file + ": not a repertoire.json that this script reads");
                return;
            }
            var clips = AssetDatabase.LoadAllAssetsAtPath(folder + "/" + table.file)
                .OfType<AnimationClip>()
                .GroupBy(clip => clip.name)
                .ToDictionary(group => group.Key, group => group.First());
            if (clips.Count == 0) return; // the GLB is not there yet
            Write(target, table, clips);
        }

        static void Write(string target, Table table, Dictionary<string, AnimationClip> clips)
        {
            var controller = AnimatorController.CreateAnimatorControllerAtPath(target);
            controller.AddParameter("turn", AnimatorControllerParameterType.Float);
            controller.AddParameter("speed", AnimatorControllerParameterType.Float);
            var walk = controller.CreateBlendTreeInController("walk", out BlendTree tree);
            tree.blendType = BlendTreeType.FreeformCartesian2D;
            tree.blendParameter = "turn";
            tree.blendParameterY = "speed";
            foreach (var clip in table.clips)
            {
                var motion = Copied(clip, clips, controller, true);
                if (motion != null) tree.AddChild(motion, new Vector2(-clip.turn, clip.speed));
            }
            var states = controller.layers[0].stateMachine;
            foreach (var way in table.transitions ?? new Clip[0])
            {
                var motion = way.found ? Copied(way, clips, controller, false) : null;
                if (motion == null) continue;
                var state = states.AddState(way.name);
                state.motion = motion;
                var onward = state.AddTransition(walk);
                onward.hasExitTime = true;
                onward.hasFixedDuration = true;
                onward.duration = Fade;
                onward.exitTime = 1f - Fade / Mathf.Max(way.duration, Fade);
            }
            states.defaultState = walk;
            AssetDatabase.SaveAssets();
        }

        // A copy of a clip in the controller's file, for imported clips cannot be changed.
        static AnimationClip Copied(
            Clip clip, Dictionary<string, AnimationClip> clips, AnimatorController owner, bool loops)
        {
            if (!clips.TryGetValue(clip.Animation, out var original))
            {
                Debug.LogWarning("repertoire.glb: has no animation " + clip.Animation);
                return null;
            }
            var copy = UnityEngine.Object.Instantiate(original);
            copy.name = clip.name;
            copy.legacy = false;
            var settings = AnimationUtility.GetAnimationClipSettings(copy);
            settings.loopTime = loops;
            AnimationUtility.SetAnimationClipSettings(copy, settings);
            var events = (clip.contacts ?? new Contact[0]).Select(fall => new AnimationEvent
            {
                time = Mathf.Min(fall.down, copy.length),
                functionName = "Footstep",
                stringParameter = fall.foot,
                messageOptions = SendMessageOptions.DontRequireReceiver,
            });
            AnimationUtility.SetAnimationEvents(copy, events.ToArray());
            AssetDatabase.AddObjectToAsset(copy, owner);
            return copy;
        }
    }
}
