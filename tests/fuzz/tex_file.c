// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * A texture (.tex): refused with a reason, or of finite numbers within their ranges, and written again it
 * is the same file.
 */
#include <fcntl.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>
#include "../../lib/model/texture.h"

static struct incise_texture *load(const void *data, size_t size)
{
	int fd = memfd_create("tex", MFD_CLOEXEC);
	struct incise_texture *texture;
	struct incise_error err = {0};
	char path[40];

	if (fd < 0 || write(fd, data, size) != (ssize_t)size)
		abort();
	snprintf(path, sizeof(path), "/proc/self/fd/%d", fd);
	texture = incise_texture_load(path, NULL, &err);
	if (!texture && (!err.code || !*err.text))
		abort();
	close(fd);
	return texture;
}

/* The bytes of its file: free(3). */
static char *save(const struct incise_texture *texture, size_t *size)
{
	char path[] = "/tmp/incise-fuzz-tex-XXXXXX", *text;
	int fd = mkstemp(path);

	if (fd < 0 || incise_texture_save(texture, path, NULL))
		abort();
	close(fd);
	fd = open(path, O_RDONLY | O_CLOEXEC);
	*size = (size_t)lseek(fd, 0, SEEK_END);
	text = malloc(*size + 1);
	if (!text || pread(fd, text, *size, 0) != (ssize_t)*size)
		abort();
	close(fd);
	unlink(path);
	return text;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
	struct incise_texture *texture = load(data, size), *again;
	struct incise_fixed_texture tables;
	char *text, *other;
	size_t n, m;

	if (!texture)
		return 0;
	text = save(texture, &n);
	again = load(text, n);
	if (!again)
		abort();
	other = save(again, &m);
	if (n != m || memcmp(text, other, n))
		abort();
	incise_texture_fill(texture, 1, texture->info.seed, &tables);
	for (int i = 0; i < INCISE_TEXTURE_KNOTS; i++)
		if (abs(tables.knot[i]) > INCISE_TEXTURE_MOST)
			abort();
	free(text);
	free(other);
	incise_texture_free(again);
	incise_texture_free(texture);
	return 0;
}
