"""Small files that earlier releases wrote, and which must be read: a folder for each release.

`sonata2d generate set --scenario scenario.yaml --episodes 2 --seed 7`, `generate shards --scenario scenario.yaml
--episodes 2 --seed 8 --shard-size 2`, and `export set/000000.json --to F -o exports/F` in that release.
"""
