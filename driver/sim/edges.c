// SPDX-License-Identifier: GPL-2.0-only
/*
 * The ring of timestamped edges and the files "edges" and "status". One writer
 * (whoever holds the simulator's lock) and one reader (the mutex): they meet
 * in head and tail only, so that a reader never delays set().
 *
 *	        tail            head
 *	 .......|###############|.......     what is held: head - tail
 *
 * A full ring loses the newest edges, so that a reading is whole up to the loss; the gap
 * shows in the sequence and is counted.
 */
#include <linux/fs.h>
#include <linux/ktime.h>
#include <linux/log2.h>
#include <linux/seq_file.h>
#include <linux/slab.h>
#include <linux/uaccess.h>
#include <linux/vmalloc.h>

#include "sim.h"

static_assert(sizeof(struct incise_sim_edge) == 16);

#define SIM_RING_MIN 16
#define SIM_RING_MAX BIT(24)

int sim_edges_init(struct sim *sim, unsigned int size)
{
	struct sim_ring *ring = &sim->ring;

	if (size < SIM_RING_MIN || size > SIM_RING_MAX)
		return -EINVAL;
	mutex_init(&ring->reader);
	ring->size = roundup_pow_of_two(size);
	ring->edge = vcalloc(ring->size, sizeof(*ring->edge));
	return ring->edge ? 0 : -ENOMEM;
}

void sim_edges_free(struct sim *sim)
{
	vfree(sim->ring.edge);
}

/* Stamped under the lock: order in the ring is order in time. */
void sim_edges_put_locked(struct sim *sim, unsigned int line, bool value,
			  unsigned int flags)
{
	struct sim_ring *ring = &sim->ring;
	struct incise_sim_edge *edge;
	u32 sequence = ring->sequence++;

	/* acquire: the reader has copied what this edge overwrites */
	if (ring->head - smp_load_acquire(&ring->tail) >= ring->size) {
		ring->lost++;
		return;
	}
	edge = &ring->edge[ring->head & (ring->size - 1)];
	edge->t_ns = ktime_get_ns();
	edge->sequence = sequence;
	edge->line = line;
	edge->value = value;
	edge->flags = flags;
	/* release: the edge is whole before the reader sees it */
	smp_store_release(&ring->head, ring->head + 1);
}

static int sim_edges_open(struct inode *inode, struct file *file)
{
	file->private_data = inode->i_private;
	return stream_open(inode, file);
}

static ssize_t sim_edges_read(struct file *file, char __user *to, size_t size,
			      loff_t *unused)
{
	struct sim *sim = file->private_data;
	struct sim_ring *ring = &sim->ring;
	ssize_t done = 0;
	int ret = 0;

	size /= sizeof(*ring->edge);
	if (!size)
		return -EINVAL;
	if (mutex_lock_interruptible(&ring->reader))
		return -ERESTARTSYS;
	while (size) {
		u32 from = ring->tail & (ring->size - 1);
		/* acquire: pairs with the release in sim_edges_put_locked() */
		u32 held = smp_load_acquire(&ring->head) - ring->tail;
		u32 count = min3(held, ring->size - from,
				 (u32)min_t(size_t, size, ring->size));

		if (!count)
			break;
		if (copy_to_user(to + done, &ring->edge[from],
				 count * sizeof(*ring->edge))) {
			ret = -EFAULT;
			break;
		}
		/* release: copied before the writer may overwrite */
		smp_store_release(&ring->tail, ring->tail + count);
		done += count * sizeof(*ring->edge);
		size -= count;
	}
	mutex_unlock(&ring->reader);
	return done ? done : ret;
}

static int sim_edges_parse(void *of, char *text)
{
	struct sim *sim = of;
	struct sim_ring *ring = &sim->ring;
	char *word = sim_text_word(&text);
	unsigned long flags;

	if (!word || strcmp(word, "reset") || sim_text_word(&text))
		return -EINVAL;
	mutex_lock(&ring->reader);
	raw_spin_lock_irqsave(&sim->lock, flags);
	ring->tail = ring->head;
	ring->sequence = 0;
	ring->lost = 0;
	ring->repeats = 0;
	raw_spin_unlock_irqrestore(&sim->lock, flags);
	mutex_unlock(&ring->reader);
	return 0;
}

static ssize_t sim_edges_write(struct file *file, const char __user *from, size_t size,
			       loff_t *unused)
{
	return sim_text_write(from, size, sim_edges_parse, file->private_data);
}

static const struct file_operations sim_edges_fops = {
	.owner = THIS_MODULE,
	.open = sim_edges_open,
	.read = sim_edges_read,
	.write = sim_edges_write,
};

static int sim_status_show(struct seq_file *seq, void *unused)
{
	struct sim *sim = seq->private;
	u64 sequence, lost, repeats, interrupts;
	unsigned long flags;
	u32 held;

	raw_spin_lock_irqsave(&sim->lock, flags);
	sequence = sim->ring.sequence;
	lost = sim->ring.lost;
	repeats = sim->ring.repeats;
	held = sim->ring.head - READ_ONCE(sim->ring.tail);
	interrupts = sim->interrupts;
	raw_spin_unlock_irqrestore(&sim->lock, flags);

	seq_printf(seq, "lines=%u\n", sim->lines);
	seq_printf(seq, "edges=%llu\n", sequence);
	seq_printf(seq, "held=%u\n", held);
	seq_printf(seq, "lost=%llu\n", lost);
	seq_printf(seq, "ring=%u\n", sim->ring.size);
	seq_printf(seq, "repeats=%llu\n", repeats);
	seq_printf(seq, "interrupts=%llu\n", interrupts);
	return 0;
}
DEFINE_SHOW_ATTRIBUTE(sim_status);

void sim_edges_files(struct sim *sim)
{
	debugfs_create_file("edges", 0600, sim->dir, sim, &sim_edges_fops);
	debugfs_create_file("status", 0400, sim->dir, sim, &sim_status_fops);
}
