// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * A plugin for MuJoCo: the tissue of a scene pushes a body. It computes the forces of incise.mujoco.attach(), and
 * needs no Python. mj_copyData() and mj_setState() copy neither its cuts nor its time. In a model:
 *
 *     <extension><plugin plugin="incise.tissue"/></extension>
 *     <body name="blade">
 *       <plugin plugin="incise.tissue">
 *         <config key="scene" value="/usr/share/incise/scenes/neck.scene"/>
 *         <config key="tip" value="tip"/>         a body or a site on this body; default: the body
 *         <config key="frame" value="patient"/>   a body or a site that the scene lies in; default: the world
 *       </plugin>
 *
 *     frame ──┐
 *     tip ────┴─ m ▶ mm ─▶ incise_host_step() ─ N mm ▶ N m ─▶ xfrc_applied of the body, which is then the plugin's
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <incise/host.h>
#include <mujoco/mujoco.h>

/* A body, or a site on one. */
struct place {
	int body, site; /* site: -1: none */
};

struct tissue {
	struct incise_scene *scene;
	struct incise_host *host;
	struct place tip, frame;
	double time; /* of the last step, s … */
	int rc;	     /* … and its result */
};

static struct tissue *tissue_of(const mjData *d, int instance)
{
	return (struct tissue *)d->plugin_data[instance];
}

/* The body that has the plugin. */
static int find_body(const mjModel *m, int instance)
{
	int body = 0;

	while (body < m->nbody && m->body_plugin[body] != instance)
		body++;
	if (body == m->nbody)
		mju_error("incise.tissue: the plugin is in no body; put it into one");
	return body;
}

static struct place find_place(const mjModel *m, int instance, const char *key,
			       int otherwise)
{
	const char *name = mj_getPluginConfig(m, instance, key);
	struct place place = {.body = otherwise, .site = -1};

	if (!name || !*name)
		return place;
	place.body = mj_name2id(m, mjOBJ_BODY, name);
	if (place.body >= 0)
		return place;
	place.site = mj_name2id(m, mjOBJ_SITE, name);
	if (place.site < 0)
		mju_error("incise.tissue: %s \"%s\": no such body or site; mend the name",
			  key, name);
	place.body = m->site_bodyid[place.site];
	return place;
}

/* Position and attitude in the world. */
static const mjtNum *read_place(const mjData *d, const struct place *place,
				mjtNum quaternion[4])
{
	bool is_site = place->site >= 0;

	mju_mat2Quat(quaternion, is_site ? d->site_xmat + 9 * place->site
					 : d->xmat + 9 * place->body);
	return is_site ? d->site_xpos + 3 * place->site : d->xpos + 3 * place->body;
}

static int count_states(const mjModel *m, int instance)
{
	(void)m, (void)instance;
	return 0;
}

static void free_tissue(mjData *d, int instance)
{
	struct tissue *tissue = tissue_of(d, instance);

	incise_host_free(tissue->host); /* before its scene */
	incise_scene_free(tissue->scene);
	free(tissue);
	d->plugin_data[instance] = 0;
}

static int make_tissue(const mjModel *m, mjData *d, int instance)
{
	const char *path = mj_getPluginConfig(m, instance, "scene");
	struct incise_host_options options = {.host_period_s = m->opt.timestep};
	struct incise_error err = {0};
	struct place tip, frame;
	struct tissue *tissue;

	if (m->opt.integrator == mjINT_RK4)
		mju_error(
			"incise.tissue: integrator \"RK4\" tries poses that never are, and a cut "
			"stays; take \"implicitfast\"");
	tip = find_place(m, instance, "tip", find_body(m, instance));
	frame = find_place(m, instance, "frame", 0);
	tissue = calloc(1, sizeof(*tissue));
	if (!tissue)
		return -1;
	d->plugin_data[instance] = (uintptr_t)tissue;
	tissue->tip = tip;
	tissue->frame = frame;
	tissue->scene = incise_scene_load(path ? path : "", NULL, &err);
	if (tissue->scene)
		tissue->host = incise_host_new(tissue->scene, &options, &err);
	if (tissue->host)
		return 0;
	free_tissue(d, instance);
	mju_error("incise.tissue: %s", err.text);
	return -1;
}

static void reset_tissue(const mjModel *m, mjtNum *state, void *data, int instance)
{
	(void)m, (void)state, (void)instance;
	incise_host_reset(((struct tissue *)data)->host);
}

/* A time that goes back is that of another episode. */
static void step_tissue(struct tissue *tissue, double time,
			const struct incise_host_pose *pose,
			struct incise_host_wrench *wrench)
{
	int rc;

	if (time < tissue->time)
		incise_host_reset(tissue->host);
	rc = incise_host_step(tissue->host, llrint(time * 1e9), pose, NULL, wrench);
	if (rc && rc != tissue->rc) /* once for a row of steps */
		mju_warning(
			"incise.tissue: at %g s %s", time,
			rc == -ESTALE
				? "the step is longer than the model's timestep: the force ramps to 0"
				: "the pose is not finite or too far away: no force");
	tissue->time = time;
	tissue->rc = rc;
}

/* The same operations as incise.mujoco, in the same order. */
static void push_body(const mjModel *m, mjData *d, int instance, int capability)
{
	struct tissue *tissue = tissue_of(d, instance);
	int body = tissue->tip.body;
	mjtNum *force = d->xfrc_applied + 6 * body, *torque = force + 3;
	mjtNum tip_turn[4], frame_turn[4], from[3], turn[4], lever[3], moment[3];
	const mjtNum *tip = read_place(d, &tissue->tip, tip_turn);
	const mjtNum *frame = read_place(d, &tissue->frame, frame_turn);
	struct incise_host_wrench wrench;
	struct incise_host_pose pose;

	(void)m, (void)capability;
	mju_negPose(from, turn, frame, frame_turn);
	mju_mulPose(pose.position_mm, pose.quaternion, from, turn, tip, tip_turn);
	mju_scl3(pose.position_mm, pose.position_mm, 1e3);
	step_tissue(tissue, d->time, &pose, &wrench);
	mju_rotVecQuat(force, wrench.force_N, frame_turn);
	mju_rotVecQuat(torque, wrench.torque_N_mm, frame_turn);
	mju_scl3(torque, torque, 1e-3);
	mju_sub3(lever, tip, d->xipos + 3 * body);
	mju_cross(moment, lever, force);
	mju_addTo3(torque, moment);
}

mjPLUGIN_LIB_INIT(incise)
{
	static const char *const keys[] = {"scene", "tip", "frame"};
	mjpPlugin plugin;

	mjp_defaultPlugin(&plugin);
	plugin.name = "incise.tissue";
	plugin.nattribute = sizeof(keys) / sizeof(keys[0]);
	plugin.attributes = keys;
	plugin.capabilityflags = mjPLUGIN_PASSIVE;
	plugin.nstate = count_states;
	plugin.init = make_tissue;
	plugin.destroy = free_tissue;
	plugin.reset = reset_tissue;
	plugin.compute = push_body;
	mjp_registerPlugin(&plugin);
}
