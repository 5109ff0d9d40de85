// SPDX-License-Identifier: GPL-2.0-only
/*
 * The words that tests write into debugfs: "key=value key=value". Everything
 * that is not exactly understood is EINVAL.
 */
#include <linux/kernel.h>
#include <linux/slab.h>
#include <linux/string.h>
#include <linux/uaccess.h>

#include "sim.h"

/* More than any sensible command. */
#define SIM_TEXT_MAX 4096

/* With a terminating zero; EINVAL if it is empty, too long or holds a zero byte. */
static char *sim_text_read(const char __user *from, size_t size)
{
	char *text;

	if (!size || size > SIM_TEXT_MAX)
		return ERR_PTR(-EINVAL);
	text = memdup_user_nul(from, size);
	if (!IS_ERR(text) && strlen(text) != size) {
		kfree(text);
		return ERR_PTR(-EINVAL);
	}
	return text;
}

/**
 * sim_text_write() - hand the text of a write to a parser
 * @from:	text in user space
 * @size:	its length
 * @parse:	0 or a negative errno; may change the text
 * @of:		for @parse
 *
 * Return: @size, or the error: a file's write function returns it as it is.
 */
ssize_t sim_text_write(const char __user *from, size_t size,
		       int (*parse)(void *of, char *text), void *of)
{
	char *text;
	int ret;

	text = sim_text_read(from, size);
	if (IS_ERR(text))
		return PTR_ERR(text);
	ret = parse(of, text);
	kfree(text);
	return ret ? ret : (ssize_t)size;
}

/* The next word, or NULL at the end. */
char *sim_text_word(char **text)
{
	char *word;

	do {
		word = strsep(text, " \t\n");
	} while (word && !*word);
	return word;
}

/* Is it "key=..."? Then @value is the rest. */
bool sim_text_key(char *word, const char *key, char **value)
{
	size_t size = strlen(key);

	if (strncmp(word, key, size) || word[size] != '=')
		return false;
	*value = word + size + 1;
	return true;
}

/* The offset of a line that the chip has. */
int sim_text_line(const struct sim *sim, const char *text, int *line)
{
	unsigned int offset;

	if (kstrtouint(text, 10, &offset) || offset >= sim->lines)
		return -EINVAL;
	*line = offset;
	return 0;
}

/* 0 or 1 and nothing else. */
int sim_text_bool(const char *text, bool *value)
{
	if ((*text != '0' && *text != '1') || text[1])
		return -EINVAL;
	*value = *text == '1';
	return 0;
}
