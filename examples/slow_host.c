// SPDX-License-Identifier: GPL-2.0-or-later
/* A simulator that steps 60 times a second lowers a scalpel into a scene: ./slow_host liver.scene */
#include <stdio.h>
#include <incise/host.h>

#define STEP_NS (INCISE_NS_PER_S / 60)

int main(int argc, char **argv)
{
	/* A tissue that is too stiff for so slow a host becomes softer. */
	struct incise_host_options options = {.host_period_s = 1.0 / 60,
					      .fit_gain = true};
	struct incise_host_pose pose = {.quaternion = {1}};
	struct incise_host_wrench wrench = {.flags = 0};
	struct incise_host *host = NULL;
	struct incise_scene *scene;
	struct incise_error err = {0};
	struct incise_tick tick;

	if (argc != 2) {
		fprintf(stderr, "usage: %s SCENE\n", argv[0]);
		return 2;
	}
	scene = incise_scene_load(argv[1], NULL, &err);
	if (scene)
		host = incise_host_new(scene, &options, &err);
	if (!host)
		fprintf(stderr, "%s: %s\n", argv[0], err.text);
	for (int n = 0; host && n < 120; n++) {
		pose.position_mm[2] = 2 - n / 12.0;
		incise_host_step(host, n * STEP_NS, &pose, NULL, &wrench);
		incise_host_last(host, &tick);
		if (n % 12 == 0)
			printf("%.1f s %6.2f mm %6.3f N\n", n / 60.0, tick.depth_mm,
			       wrench.force_N[2]);
	}
	incise_host_free(host); /* before its scene */
	incise_scene_free(scene);
	return err.code ? 1 : 0;
}
