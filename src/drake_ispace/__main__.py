from drake_ispace.cli import main

main()
