// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/gpio/gpio_chips.c on nodes that a test makes: one chip of a name is found, under either of its nodes;
 * several are listed; without one the reason is the best that is known.
 */
#include "../unit.h"
#include <glob.h>
#include <sys/stat.h>
#include "../../../lib/device/gpio/gpio_lines.h"

static struct node {
	const char *path, *label;
	int device, error;
} * node;
static size_t n_nodes;

static const struct node *node_of(const char *path)
{
	for (size_t i = 0; i < n_nodes; i++)
		if (!strcmp(node[i].path, path))
			return &node[i];
	return NULL;
}

int gpio_chip_called(const char *path, const char *name)
{
	const struct node *of = node_of(path);

	return of->error ? -of->error : !strcmp(of->label, name);
}

int __wrap_stat(const char *path, struct stat *st)
{
	st->st_rdev = (dev_t)node_of(path)->device;
	return 0;
}

int __wrap_glob(const char *pattern, int flags, int (*fail)(const char *, int),
		glob_t *found)
{
	static char *paths[8];

	for (size_t i = 0; i < n_nodes; i++)
		paths[i] = (char *)(uintptr_t)node[i].path;
	found->gl_pathc = n_nodes;
	found->gl_pathv = paths;
	return n_nodes ? 0 : GLOB_NOMATCH;
}

void __wrap_globfree(glob_t *found)
{
}

static int find(struct node *nodes, size_t n, const char *name, char *path, char *several)
{
	node = nodes;
	n_nodes = n;
	strcpy(path, "");
	strcpy(several, "");
	return gpio_chip_find(name, path, several);
}

TEST(a_chip_is_found_once)
{
	struct node nodes[] = {{"/dev/gpiochip0", "pinctrl-bcm2711", 1, 0},
			       {"/dev/gpiochip1", "cp210x", 2, 0},
			       {"/dev/gpiochip2", "cp210x", 3, 0},
			       {"/dev/gpiochip3", "secret", 4, EACCES},
			       {"/dev/gpiochip4", "pinctrl-bcm2711", 1, 0}};
	char path[GPIO_PATH_MAX], several[GPIO_SEVERAL_MAX];

	assert_int_equal(find(nodes, 5, "pinctrl-bcm2711", path, several), 0);
	assert_string_equal(path, "/dev/gpiochip0");
	assert_int_equal(find(nodes, 5, "cp210x", path, several), -ENOTUNIQ);
	assert_string_equal(several, "/dev/gpiochip1, /dev/gpiochip2");
	assert_int_equal(find(nodes, 3, "cp2104", path, several), -ENOENT);
	assert_int_equal(find(nodes, 5, "cp2104", path, several), -EACCES);
	assert_int_equal(find(nodes, 0, "cp2104", path, several), -ENOENT);
	/* A path is what it says, also where its label is not unique. */
	assert_int_equal(find(nodes, 5, "/dev/gpiochip2", path, several), 0);
	assert_string_equal(path, "/dev/gpiochip2");
}
